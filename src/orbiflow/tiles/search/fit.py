"""What every method of fitting gives."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

from orbiflow.tiles.search.model import TileModel

if TYPE_CHECKING:
    from orbiflow.tiles.search.bending_fit import PlacedBent

Progress = Callable[[float, float], None]
"""Called with the share of the work done and the best loss so far."""


def silent(_share: float, _loss: float) -> None:
    """No progress wanted."""


class Fit(NamedTuple):
    """Finalists of one class, not certified yet.

    - `model`: best first.
    - `starts`: candidates that the method began with.
    - `crossed`: of these, how many were dropped on the way because their boundary crossed itself.
    - `enough`: certified finalists after which the others need not be looked at.
    - `bent`: of a search for likeness, the bent silhouette of each finalist.
    """

    model: TileModel
    starts: int
    crossed: int
    enough: int
    bent: tuple[PlacedBent, ...] = ()
