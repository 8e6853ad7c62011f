"""The flow of vector fields: a diffeomorphism, its inverse and its log-determinant."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator
from typing import Self

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields.derivatives import with_divergence
from orbiflow.fields.symmetrize import VectorField
from orbiflow.flows.integrators import RungeKutta
from orbiflow.flows.integrators import method as find_method


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
        self._duration = float(duration)
        self._steps = _checked_steps(steps)
        self._method: RungeKutta = find_method(method)

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in each segment; see `with_steps`."""
        return self._steps

    @property
    def method(self) -> str:
        """Name of the integrator."""
        return self._method.name

    @property
    def duration(self) -> float:
        """Length of time of each segment."""
        return self._duration

    def with_steps(self, steps: int, *, method: str | None = None) -> Self:
        """The same flow integrated otherwise: a view that shares fields and parameters.

        This flow stays as it is, so others that hold it notice nothing. A view has the same
        `state_dict`; training it trains this flow.

        Args:
            steps: Runge-Kutta steps in each segment.
            method: as in the constructor; default this flow's.

        Raises:
            OrbiflowError: for `steps` < 1 or an unknown method.

        >>> flow = Flow(torch.sin, steps=8)
        >>> flow.with_steps(2 * flow.steps).steps, flow.steps
        (16, 8)
        """
        view = copy.copy(self)  # shallow: of modules and parameters it holds the very same
        view._steps = _checked_steps(steps)
        if method is not None:
            view._method = find_method(method)
        return view

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
        finer = self.with_steps(2 * self.steps)
        fine = finer.inverse(points) if inverse else finer(points)
        return float((apply(points) - fine).norm(dim=-1).max())

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


def _checked_steps(value: int) -> int:
    if isinstance(value, bool) or int(value) != value or value < 1:
        raise OrbiflowError(f"steps must be an integer of at least 1, got {value!r}")
    return int(value)


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
