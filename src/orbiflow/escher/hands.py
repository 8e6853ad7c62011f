"""A silhouette and its mirror image, sampled coarse to fine and made elastic, for the search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from orbiflow.escher.bending_settings import BendingSettings
from orbiflow.likeness.elastic import Elastic, Stiffness
from orbiflow.likeness.pinned import Pinned
from orbiflow.silhouette.emphasis import Emphasis
from orbiflow.silhouette.mesh import triangulate
from orbiflow.silhouette.pins import Pins
from orbiflow.silhouette.sampling import Samples, sampled
from orbiflow.silhouette.target import Target
from orbiflow.symmetry.isometry import Array

FIRM = Stiffness(salience=-0.5, pose=60.0)
"""Of the search: bodies and heads are stiff; thin parts are not, and keep their places.

Tiles bent so cost more by the usual stiffness than the least, and are seen to be more like the
silhouette: docs/likeness.md has the comparison.
"""

SOFT = Stiffness(salience=0.0)
"""Of the search where too few tiles of a firm body are simple: many long limbs, which cross."""


class Bodies(NamedTuple):
    """An elastic silhouette with few points, more and all."""

    coarse: Elastic
    middle: Elastic
    fine: Elastic


@dataclass(frozen=True, eq=False)
class Hand:
    """A silhouette or its mirror image.

    - `mirrored`: whether the latter.
    - `samples`: points of its outline, coarse to fine.
    - `made`: the elastic body of a level of points, "coarse", "middle" or "fine", and a stiffness.
    """

    mirrored: bool
    samples: Samples
    made: Callable[[str, Stiffness], Elastic]
    _bodies: dict[Stiffness, Bodies] = field(default_factory=dict[Stiffness, Bodies])

    @cached_property
    def fine(self) -> Elastic:
        """The body of usual stiffness with all points: what costs are measured by."""
        return self.made("fine", Stiffness())

    def bodies(self, stiffness: Stiffness) -> Bodies:
        """The bodies of a stiffness, made when they are first asked for."""
        found = self._bodies.get(stiffness)
        if found is None:
            coarse, fine = self.made("coarse", stiffness), self.made("fine", stiffness)
            same = len(self.samples.middle) == len(self.samples.fine)
            middle = fine if same else self.made("middle", stiffness)
            found = self._bodies[stiffness] = Bodies(coarse, middle, fine)
        return found


def hands(
    target: Target,
    settings: BendingSettings,
    *,
    emphasis: Emphasis | None = None,
    pins: Pins | None = None,
) -> tuple[Hand, Hand]:
    """The silhouette and its mirror image in the x axis, ready to be bent.

    Args:
        target: the silhouette.
        settings: of the search.
        emphasis: what is to bend less, by as much as it matters more.
        pins: what is not to bend.

    Raises:
        OrbiflowError: for a silhouette that cannot be sampled or triangulated.
    """
    phase = float(np.random.default_rng(settings.seed).random()) if settings.seed else 0.0
    samples = sampled(np.asarray(target.normal), phase, settings.multiples)
    # read backwards from the same first point: every k-th fine point stays beside a coarse one
    mirror = Samples(*(np.roll(part[::-1], 1, axis=0) * (1.0, -1.0) for part in samples))

    def hand(points: Samples, mirrored: bool) -> Hand:
        meshes = {name: triangulate(ring) for name, ring in points._asdict().items()}

        def made(level: str, stiffness: Stiffness) -> Elastic:
            ring: Array = getattr(points, level)
            mesh = meshes[level]
            own = mesh.points * ((1.0, -1.0) if mirrored else (1.0, 1.0))
            stiff = None if emphasis is None else emphasis.weight(own)
            if pins is None:
                return Elastic(ring, stiffness, stiff=stiff, mesh=mesh)
            parts, angle = pins.parts(own, mesh.triangles), pins.keep_angle
            return Pinned(ring, parts, stiffness, keep_angle=angle, stiff=stiff, mesh=mesh)

        return Hand(mirrored, points, made)

    return hand(samples, False), hand(mirror, True)
