"""The route of the shapes to begin with; what makes them is imported when somebody asks for them."""

from __future__ import annotations

from typing import Any

from orbiflow.studio.routes import Routes, Studio

routes = Routes()


@routes("GET", "/shapes")
def shapes(here: Studio, every: int = 0) -> list[dict[str, Any]]:
    """Return the nine classes in which every shape of tile occurs, or the other types."""
    from orbiflow.studio.shapes import shape
    from orbiflow.tiles import CLASSES, ISOHEDRAL_TYPES

    del here
    names = [name for name in ISOHEDRAL_TYPES if name not in CLASSES] if every else list(CLASSES)
    return [shape(name) for name in names]
