"""The flow of vector fields: a diffeomorphism, its inverse and its log-determinant."""

import contextlib
import copy
import math
from collections.abc import Callable, Iterable
from typing import Any, Self

import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.fields import (
    VectorField,
    lipschitz_bound,
    prepared,
    prepared_with_divergence,
    prepared_with_jacobian,
)
from orbiflow.flows.integrators import RungeKutta, StepCheck
from orbiflow.flows.integrators import method as runge_kutta
from orbiflow.runtime import one_thread
from orbiflow.settings import as_number, as_whole, is_a
from orbiflow.typed_torch import linalg

State = tuple[Tensor, ...]
Step = Callable[[Callable[[State], State], State, float], State]

# the number of coordinates from which several threads can be faster than one
MULTITHREADED_COORDINATES = 2**17
MAX_INJECTIVE_STEPS = 4096  # steps of a segment beyond which a field counts as too steep


class _FunctionSegment(nn.Module):
    """A module that holds a plain callable."""

    def __init__(self, field: VectorField) -> None:
        super().__init__()
        self.field = field

    def forward(self, points: Tensor) -> Tensor:
        return self.field(points)


class Flow(nn.Module):
    """The time-one map of dx/dt = V(x), or of several fields one after another.

    One segment is the paper's model (section 2.1); more are more expressive (design point 5), as a
    field that changes with time would be. If every field commutes with a group, so does the flow, up to
    rounding, for any number of steps. Few points are moved on one thread; torch runs the backward
    passes of training itself, so run those inside `orbiflow.runtime.one_thread`.

    A likelihood that is maximised through few steps exploits their error: the log-determinant, an
    integral along the path, is then not that of the map. With `bijective`, it is exact at any number
    of steps. The map is a product of Runge-Kutta steps, each of which is injective because it is
    shorter than the fields' Lipschitz bounds allow (`RungeKutta.injective_below`), so the map is a
    bijection; and the derivatives of the steps are multiplied instead of integrated. Whatever the
    fields become, a density that is carried by the map, by `inverse_and_log_det` or by
    `forward_and_log_det`, integrates to one.

    Args:
        fields: The vector fields, one per segment, from points (..., d) to vectors (..., d).
        steps: The number of Runge-Kutta steps in each segment.
        method: "euler", "midpoint", "rk3", "rk4" or "rk5".
        duration: The length of time of each segment.
        warn: Whether to check, for new parameters, that the steps are fine enough.
        bijective: Whether to take, at each call, at least so many steps that each is injective, and
            the log-determinants of the steps themselves. `forward` and `inverse` are two bijections,
            inverse to each other up to the integrator's error. Costs the fields' Jacobians in place
            of their divergences.

    Raises `OrbiflowError` for no field, `steps` < 1 or an unknown method, and with `bijective` for a
    field without `lipschitz_bound`; when called, for points of a dtype or shape that the fields do
    not take, a field whose values have another shape, or one that is too steep for `bijective`.

    Warns:
        CoarseStepsWarning: once, when called, if the steps are too coarse for the fields.

    >>> import torch
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
        warn: bool = True,
        bijective: bool = False,
    ) -> None:
        super().__init__()
        untyped: Any = fields
        several = isinstance(fields, nn.ModuleList) or not callable(fields)
        listed: list[Any] = list(untyped) if several else [untyped]
        if not listed:
            raise OrbiflowError("a flow needs at least one vector field")
        for field in listed:
            if not callable(field):
                how = "a field is a callable from points to vectors"
                raise OrbiflowError(f"{how}, got {field!r}: see orbiflow.fields")
        self.segments = nn.ModuleList(
            f if isinstance(f, nn.Module) else _FunctionSegment(f) for f in listed
        )
        self._duration = as_number(duration, "duration")
        self._steps = as_whole(steps, "steps", 1)
        self.integrator: RungeKutta = runge_kutta(method)
        self._step_check = StepCheck() if warn and not bijective else None
        self._bijective = bool(bijective)
        _ = self.steps  # a mistake in the fields is told at once

    @property
    def steps(self) -> int:
        """Runge-Kutta steps in each segment; see `with_steps`.

        If the flow is `bijective`, so many as its fields need now, and at least those given.
        """
        if not self.bijective:
            return self._steps
        return max([self._steps, *map(self._injective_steps, self.fields())])

    @property
    def bijective(self) -> bool:
        """Whether each step is injective, and log-determinants are those of the steps."""
        return self._bijective

    @property
    def duration(self) -> float:
        """Length of time of each segment."""
        return self._duration

    @property
    def method(self) -> str:
        """Name of the integrator."""
        return self.integrator.name

    @property
    def warns(self) -> bool:
        """Whether the flow checks that its steps are fine enough."""
        return self._step_check is not None

    def fields(self) -> list[Any]:
        """Return the given vector fields, one per segment."""
        return [s.field if isinstance(s, _FunctionSegment) else s for s in self.segments]

    def with_steps(self, steps: int, *, method: str | None = None) -> Self:
        """Return a view of the flow, with the same fields and parameters, integrated otherwise.

        This flow does not change. The view has the same `state_dict`; training it trains this flow.
        Both arguments are as in the constructor; the default method is this flow's.

        >>> flow = Flow(lambda points: 0 * points, steps=8)
        >>> flow.with_steps(2 * flow.steps).steps, flow.steps
        (16, 8)
        """
        view = copy.copy(self)  # shallow: it shares modules and parameters
        view._steps = as_whole(steps, "steps", 1)
        if method is not None:
            view.integrator = runge_kutta(method)
        view._step_check = None if self._step_check is None else StepCheck()
        return view

    def _injective_steps(self, field: VectorField) -> int:
        """Return the least number of steps of a segment that are injective by the field's bound."""
        bound = lipschitz_bound(field)
        if bound is None:
            raise OrbiflowError(
                f"a bijective flow needs fields that bound their slope, and {field!r} has no "
                "lipschitz_bound(): use a FourierField or a Sequential of linear layers and "
                "activations (symmetrized with periodic=True), give it that method, or leave out "
                "bijective"
            )
        needed = abs(self.duration) * bound / self.integrator.injective_below
        if not needed < MAX_INJECTIVE_STEPS:
            raise OrbiflowError(
                f"a field became so steep (Lipschitz bound {bound:.3g}) that a bijective flow needs "
                f"{needed:.3g} {self.method} steps in its segment, of at most {MAX_INJECTIVE_STEPS}: "
                "lower the learning rate, or add a penalty on the parameters to the loss"
            )
        return math.floor(needed) + 1

    def forward(self, points: Tensor) -> Tensor:
        """Return where the flow takes points (..., d)."""
        self._check(points)
        return self.carried(points)

    def inverse(self, points: Tensor) -> Tensor:
        """Return where points (..., d) come from: the equation backwards, to the integrator's order."""
        self._check(points, inverse=True)
        return self.carried(points, inverse=True)

    def carried(self, points: Tensor, *, inverse: bool = False) -> Tensor:
        """Return `forward` or `inverse` without the check that the steps are fine enough."""
        return self._moved((points,), inverse=inverse)[0]

    def forward_and_log_det(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Return `forward` and the log-determinant (...,) of its Jacobian, from one integration.

        It is the integral of the divergence along the path (paper, section 5.2), or that of the
        steps if the flow is `bijective`.
        """
        self._check(points)
        return self._with_log_det(points, inverse=False)

    def inverse_and_log_det(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Return `inverse` and the log-determinant of the inverse's Jacobian."""
        self._check(points, inverse=True)
        return self._with_log_det(points, inverse=True)

    def log_abs_det_jacobian(self, points: Tensor) -> Tensor:
        """Return log |det D forward| at points (..., d), as (...,)."""
        return self.forward_and_log_det(points)[1]

    def _check(self, points: Tensor, *, inverse: bool = False) -> None:
        _check_points(points)
        if self._step_check is not None:
            self._step_check.look(self, points, inverse=inverse)

    def _with_log_det(self, points: Tensor, *, inverse: bool) -> tuple[Tensor, Tensor]:
        start = (points, points.new_zeros(points.shape[:-1]))
        return self._moved(start, inverse=inverse)  # pyright: ignore[reportReturnType]

    def _moved(self, state: State, *, inverse: bool) -> State:
        """Return what becomes of points (..., d), and of their log-determinants if they are given."""
        points, steps, fields = state[0], self.steps, self.fields()
        h = (-self.duration if inverse else self.duration) / steps
        exact = self.bijective and len(state) == 2
        step: Step = self._differentiated_step if exact else self.integrator.step
        small = points.device.type == "cpu" and points.numel() < MULTITHREADED_COORDINATES
        with one_thread() if small else contextlib.nullcontext():
            try:
                for field in reversed(fields) if inverse else fields:
                    # fields prepare their weights once per segment, not once per stage
                    slope = _slope(field, with_log_det=len(state) == 2, exact=exact)
                    for _ in range(steps):
                        state = step(slope, state, h)
            except RuntimeError as error:
                self._explain(points, error)
                raise
        return state

    def _differentiated_step(
        self, slope: Callable[[State], State], state: State, h: float
    ) -> State:
        """Return the points after a step, and log-determinants with that of the step's Jacobian."""

        def tangents(both: State) -> State:
            values, jacobian = slope((both[0],))
            return values, jacobian @ both[1]

        points, log_det = state
        unit = torch.eye(points.shape[-1], dtype=points.dtype, device=points.device)
        start = (points, unit.expand(*points.shape, -1))
        # a method's step of the variational equation is the derivative of its step
        moved, derivative = self.integrator.step(tangents, start, h)
        return moved, log_det + linalg.slogdet(derivative).logabsdet

    def _explain(self, points: Tensor, error: RuntimeError) -> None:
        """Explain torch's error if the dtypes of points and parameters differ."""
        for name, parameter in self.named_parameters():
            if parameter.is_floating_point() and parameter.dtype != points.dtype:
                raise OrbiflowError(
                    f"points of dtype {points.dtype}, but {name} has {parameter.dtype}: convert the "
                    f"points with .to({parameter.dtype}) or the flow with .to({points.dtype})"
                ) from error

    def extra_repr(self) -> str:
        text = f"steps={self.steps}, method={self.method}, duration={self.duration}"
        return f"{text}, bijective=True" if self.bijective else text


def _check_points(points: Tensor) -> None:
    if not is_a(points, Tensor):
        raise OrbiflowError(
            f"expected points as a torch tensor (..., d), got a {type(points).__name__}: "
            "torch.as_tensor makes one"
        )
    if not points.is_floating_point() or points.dim() == 0:
        raise OrbiflowError(
            f"expected points (..., d) of a floating-point dtype, got {points.dtype} of shape "
            f"{tuple(points.shape)}"
        )


def _slope(field: VectorField, *, with_log_det: bool, exact: bool) -> Callable[[State], State]:
    """Return the field as a function of states: its values, with divergence or Jacobian if wanted."""
    joint = prepared_with_jacobian if exact else prepared_with_divergence
    evaluate: Any = joint(field) if with_log_det else prepared(field)

    def slope(state: State) -> State:
        points = state[0]
        slopes: State = evaluate(points) if with_log_det else (evaluate(points),)
        if slopes[0].shape != points.shape:
            raise OrbiflowError(
                "a field must give vectors of its points' shape: expected "
                f"{tuple(points.shape)}, got {tuple(slopes[0].shape)}"
            )
        return slopes

    return slope
