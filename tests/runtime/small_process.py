"""To be imported by processes of tests: their searches are small."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import orbiflow.solids
from small_searches import small_searches

if TYPE_CHECKING:
    from orbiflow.solids import EscherSolid, FillSettings, Mesh

kept = small_searches()
kept.__enter__()


def small_fill(mesh: Mesh, settings: FillSettings, **more: Any) -> list[EscherSolid]:
    """Search for solids from few poses and coarse bodies, with few cells."""
    from orbiflow.solids import search
    from solids.small_fills import small_fills

    with small_fills():
        return search.fill(mesh, settings.replace(detail=5000), **more)


orbiflow.solids.fill = small_fill  # pyright: ignore[reportAttributeAccessIssue]
