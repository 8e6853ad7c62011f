"""Neural flows on tori of many angles, where a box of Fourier waves would be too large."""

from __future__ import annotations

from orbiflow.fields import (
    NeuralTorusField,
)
from orbiflow.flows import Flow


class NeuralFlow(Flow):
    """The time-one map of dx/dt = V(x, t), V a `NeuralTorusField`: a diffeomorphism of the torus.

    A `Flow` of a single time-dependent segment. Being periodic, it commutes with integer shifts at any
    number of steps.

    Args:
        field: of the motion.
        steps: Runge-Kutta steps from time 0 to 1.
        method: "euler", "midpoint", "rk3", "rk4" or "rk5".

    Raises:
        OrbiflowError: for `steps` < 1 or an unknown method.

    >>> import torch
    >>> flow = NeuralFlow(NeuralTorusField(7))
    >>> points = torch.rand(5, 7, dtype=torch.float64)
    >>> bool(torch.equal(flow(points), points))  # a new field is zero
    True
    """

    def __init__(self, field: NeuralTorusField, *, steps: int = 8, method: str = "rk4") -> None:
        # whoever fits one settles its steps
        super().__init__(field, steps=steps, method=method, warn=False)

    @property
    def field(self) -> NeuralTorusField:
        """The vector field."""
        field = self.segments[0]
        assert isinstance(field, NeuralTorusField)  # by construction
        return field
