"""The flow of vector fields: a diffeomorphism, its inverse and its log-determinant."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.derivatives import with_divergence
from orbiflow.fields.symmetrize import VectorField
from orbiflow.flows.integrators import RungeKutta, method


class _Plain(nn.Module):
    """Holds a plain callable in a module list."""

    def __init__(self, field: VectorField) -> None:
        super().__init__()
        self.field = field

    def forward(self, points: Tensor) -> Tensor:
        return self.field(points)


class Flow(nn.Module):
    """The time-one map of dx/dt = V(x), or of several fields one after another.

    Each segment is stationary and lasts `duration`; one segment is the paper's model (section 2.1),
    more are more expressive (design point 5). If every field commutes with a group, so does the flow,
    to rounding, at any number of steps.

    Args:
        fields: vector fields, one a segment: points (..., d) to vectors (..., d).
        steps: Runge-Kutta steps in each segment.
        method: "euler", "midpoint", "rk3", "rk4" or "rk5".
        duration: length of time of each segment.

    Raises:
        OrbiflowError: for no field, `steps` < 1 or an unknown method.

    >>> from orbiflow.fields import FourierField
    >>> from orbiflow.symmetry import wallpaper_group
    >>> flow = Flow(FourierField(wallpaper_group("pgg"), 3), steps=8)
    >>> points = torch.rand(5, 2, dtype=torch.float64)
    >>> bool(torch.equal(flow(points), points))  # a new field is zero
    True
    """

    def __init__(
        self,
        fields: VectorField | Iterable[VectorField],
        *,
        steps: int = 16,
        method: str = "rk4",
        duration: float = 1.0,
    ) -> None:
        super().__init__()
        if isinstance(fields, nn.ModuleList) or not callable(fields):
            listed = list(fields)
        else:
            listed = [fields]
        if not listed:
            raise OrbiflowError("a flow needs at least one vector field")
        self.segments = nn.ModuleList(f if isinstance(f, nn.Module) else _Plain(f) for f in listed)
        self.duration = float(duration)
        self.steps = steps
        self.method = method

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in each segment; may be changed at any time."""
        return self._steps

    @steps.setter
    def steps(self, value: int) -> None:
        if isinstance(value, bool) or int(value) != value or value < 1:
            raise OrbiflowError(f"steps must be an integer of at least 1, got {value!r}")
        self._steps = int(value)

    @property
    def method(self) -> str:
        """Name of the integrator."""
        return self._method.name

    @method.setter
    def method(self, name: str) -> None:
        self._method: RungeKutta = method(name)

    def forward(self, points: Tensor) -> Tensor:
        """Where points (..., d) are carried."""
        return self._last(self._walk((points,), _slopes(self.segments), self.duration))[0]

    def inverse(self, points: Tensor) -> Tensor:
        """Where points (..., d) come from: the same equation backwards, to the integrator's order."""
        reverse = _slopes(reversed(self.segments))
        return self._last(self._walk((points,), reverse, -self.duration))[0]

    def forward_and_log_det(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """`forward` and the log-determinant of its Jacobian, from one integration.

        The second is the integral of the divergence along the path (instantaneous change of
        variables; paper, section 5.2), shape (...,).
        """
        return self._with_log_det(points, self.segments, self.duration)

    def inverse_and_log_det(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """`inverse` and the log-determinant of the inverse's Jacobian."""
        return self._with_log_det(points, reversed(self.segments), -self.duration)

    def log_abs_det_jacobian(self, points: Tensor) -> Tensor:
        """log |det D forward| at points (..., d), as (...,)."""
        return self.forward_and_log_det(points)[1]

    def trajectories(self, points: Tensor) -> Tensor:
        """The paths: (T + 1, ..., d) with T = segments x steps, the points themselves first."""
        states = self._walk((points,), _slopes(self.segments), self.duration)
        return torch.stack([points, *(state[0] for state in states)])

    @torch.no_grad()
    def error_estimate(self, points: Tensor, *, inverse: bool = False) -> float:
        """Largest distance between the results with `steps` and with twice as many.

        For a method of order p the error at `steps` is about 2^p / (2^p - 1) times this.
        """
        apply = self.inverse if inverse else self.forward
        coarse = apply(points)
        with self.with_steps(2 * self.steps):
            fine = apply(points)
        return float((coarse - fine).norm(dim=-1).max())

    def with_steps(self, steps: int) -> _StepsSet:
        """Context manager: another number of steps inside a `with` block."""
        return _StepsSet(self, steps)

    def _with_log_det(
        self, points: Tensor, segments: Iterable[nn.Module], duration: float
    ) -> tuple[Tensor, Tensor]:
        start = (points, points.new_zeros(points.shape[:-1]))
        slopes = (_joint_slope(field) for field in segments)
        moved, log_det = self._last(self._walk(start, slopes, duration))
        return moved, log_det

    def _walk(
        self,
        state: tuple[Tensor, ...],
        slopes: Iterable[Callable[[tuple[Tensor, ...]], tuple[Tensor, ...]]],
        duration: float,
    ) -> Iterator[tuple[Tensor, ...]]:
        for slope in slopes:
            for _ in range(self.steps):
                state = self._method.step(slope, state, duration / self.steps)
                yield state

    @staticmethod
    def _last(states: Iterator[tuple[Tensor, ...]]) -> tuple[Tensor, ...]:
        last: tuple[Tensor, ...] = ()
        for state in states:
            last = state
        return last

    def extra_repr(self) -> str:
        return f"steps={self.steps}, method={self.method}, duration={self.duration}"


class _StepsSet:
    def __init__(self, flow: Flow, steps: int) -> None:
        self._flow, self._steps, self._before = flow, steps, flow.steps

    def __enter__(self) -> Flow:
        self._flow.steps = self._steps
        return self._flow

    def __exit__(self, *_: object) -> None:
        self._flow.steps = self._before


def _slopes(
    segments: Iterable[nn.Module],
) -> Iterator[Callable[[tuple[Tensor, ...]], tuple[Tensor, ...]]]:
    for field in segments:
        # fields that prepare weights do so once a segment, not once a stage
        bound = field.bound() if hasattr(field, "bound") else field  # type: ignore[operator]
        yield lambda state, bound=bound: (bound(state[0]),)


def _joint_slope(field: nn.Module) -> Callable[[tuple[Tensor, ...]], tuple[Tensor, ...]]:
    inner = field.field if isinstance(field, _Plain) else field
    both = with_divergence(inner)  # type: ignore[arg-type]
    return lambda state: both(state[0])
