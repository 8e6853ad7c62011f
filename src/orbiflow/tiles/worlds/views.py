"""How a world is seen on a page: a sphere from outside, models of the hyperbolic plane, a spiral."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from orbiflow.arrays import Array
from orbiflow.tiles.page import Curve
from orbiflow.tiles.worlds.curved import disc_of

Model = Literal["sphere", "disc", "half-plane", "band", "spiral", "cylinder", "sheet"]

EDGE = 0.02  # of the page's shorter side, around a sphere or a disc
HEIGHT = 0.08  # of the page's height, at which the middle of a half-plane lies
CIRCLE_SIDES = 360


@dataclass(frozen=True, eq=False)
class WorldView:
    """What takes vectors (..., 3) of a world to places in mm on a page, y down.

    - `model`: What the page shows.
    - `size`: The page's width and height in mm.
    - `motion`: What is done to vectors first (3, 3).
    - `period`: Of a spiral or cylinder, the lattice vector of the plane that is a turn around it.
    """

    model: Model
    size: tuple[float, float]
    motion: Array
    period: complex = 1.0

    @property
    def middle(self) -> Array:
        """The page's middle (2,)."""
        return np.array(self.size) / 2

    @property
    def radius(self) -> float:
        """The radius in mm of a sphere or a disc; of a spiral, the distance of the page's corners."""
        if self.model == "spiral":
            return float(np.linalg.norm(self.middle))
        return (0.5 - EDGE) * min(self.size)

    def places(self, vectors: Array) -> Array:
        """Return the places (..., 2) of vectors (..., 3); what is behind a sphere lies on its edge."""
        moved = vectors @ self.motion.T
        if self.model == "sphere":
            flat = moved[..., :2]
            far = np.linalg.norm(flat, axis=-1, keepdims=True)
            flat = np.where(moved[..., 2:] >= 0, flat, flat / np.maximum(far, 1e-12))
            return self.middle + self.radius * flat * (1.0, -1.0)
        z, scale = self._plane(moved)
        return self.middle + scale * np.stack([z.real, -z.imag], axis=-1)

    def meets(self, places: Array) -> Any:
        """Return which shapes (M,), of places (M, N, 2), come onto the page, by their boxes."""
        low, high = places.min(axis=1), places.max(axis=1)
        return (high > 0).all(axis=1) & (low < self.size).all(axis=1)

    def _plane(self, moved: Array) -> tuple[Any, float]:
        """Return complex numbers about the page's middle, and the mm of their unit."""
        if self.model == "spiral":
            turn = 2j * np.pi * (moved[..., 0] + 1j * moved[..., 1]) / self.period
            return np.exp(turn), self.radius
        if self.model == "cylinder":
            return (moved[..., 0] + 1j * moved[..., 1]) / self.period, self.size[0]
        z = disc_of(moved)
        if self.model == "disc":
            return z, self.radius
        with np.errstate(all="ignore"):
            other = (1 + z) / (1 - z)
            if self.model == "band":
                return 2 / np.pi * np.log(other), self.size[1] / 2
            unit = HEIGHT * self.size[1]
            return 1j * other - 0.5j * self.size[1] / unit, unit

    def behind(self, vectors: Array) -> Array:
        """Return which vectors (...,) are on the far side of a sphere."""
        return (
            (vectors @ self.motion.T)[..., 2] < 0
            if self.model == "sphere"
            else np.zeros(vectors.shape[:-1], dtype=bool)
        )

    @property
    def border(self) -> Curve | None:
        """The edge of the world on the page, if it has one that is not the page's."""
        if self.model not in ("sphere", "disc"):
            return None
        turns = np.linspace(0, 2 * np.pi, CIRCLE_SIDES, endpoint=False)
        circle = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        return Curve.polyline(self.middle + self.radius * circle, closed=True)
