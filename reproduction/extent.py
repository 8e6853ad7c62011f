"""How much work a reproduction may be: whole, or a preview."""

from __future__ import annotations

from typing import NamedTuple


class Extent(NamedTuple):
    """Knobs of all exhibits.

    - `name`: "full" or "fast".
    - `frequencies`: Omega of the ablation, the paper's 5 among them.
    - `affine`, `iterations`: steps of both phases of the paper's method.
    - `effort`: of our own searches.
    - `classes`: that our own searches try for each goal, None for all nine.
    - `points`: drawn from each target density.
    - `evaluations`: of each density's likelihood and gradient.
    - `round_measure`: whether densities are fitted with respect to the round area, too.
    - `grid`: points along a side at which KL divergences are taken.
    - `resolution`: of surfaces in space, cells along a side.
    """

    name: str
    frequencies: tuple[int, ...]
    affine: int
    iterations: int
    effort: str
    classes: tuple[str, ...] | None
    points: int
    evaluations: int
    round_measure: bool
    grid: int
    resolution: int


FULL = Extent(
    name="full",
    frequencies=(0, 1, 2, 3, 5, 10),
    affine=80,
    iterations=200,
    effort="normal",
    classes=None,
    points=65_536,
    evaluations=150,
    round_measure=True,
    grid=200,
    resolution=160,
)
"""Everything as far as ten minutes on two cores go."""

FAST = Extent(
    name="fast",
    frequencies=(0, 2, 5),
    affine=30,
    iterations=30,
    effort="fast",
    classes=("IH6",),
    points=2_048,
    evaluations=24,
    round_measure=False,
    grid=100,
    resolution=100,
)
"""A minute: every exhibit, with less work in each."""
