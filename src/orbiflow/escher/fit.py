"""What every method of fitting gives."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from orbiflow.escher.model import TileModel

Progress = Callable[[float, float], None]
"""Called with the share of the work done and the best loss so far."""


class Fit(NamedTuple):
    """Finalists of one class, not certified yet.

    - `model`: best first.
    - `starts`: candidates that the method began with.
    - `crossed`: of these, how many were dropped on the way because their boundary crossed itself.
    - `enough`: certified finalists after which the others need not be looked at.
    """

    model: TileModel
    starts: int
    crossed: int
    enough: int
