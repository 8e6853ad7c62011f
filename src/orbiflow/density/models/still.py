"""A flow that moves nothing, for densities whose parts need none."""

from __future__ import annotations

from orbiflow.density.models.neural import NeuralFlow, NeuralTorusField
from orbiflow.density.spaces.space import Space
from orbiflow.fields import SplineField
from orbiflow.flows import Flow

MOST_DIM = 3
"""Dimensions of a spline's grid; beyond, it would be too large."""


def still_flow(space: Space) -> Flow:
    """A flow on the space that is the identity: a new field is zero.

    >>> from orbiflow.density import make_space
    >>> len(still_flow(make_space("torus")).segments)
    1
    """
    if space.dim > MOST_DIM:
        return NeuralFlow(NeuralTorusField(space.dim, width=1, depth=1, waves=1), steps=1)
    return Flow([SplineField(space.group, 1)], steps=1, warn=False)
