"""What every density on an identification space can do, whatever it is made of."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import torch
from torch import Tensor
from torch.distributions import constraints

from orbiflow.density.models.figures import WithFigures
from orbiflow.density.models.tensors import destination, moved, shape_of, source_of
from orbiflow.density.spaces import CHART, Space, check_measure
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import SideBySide, Tell, one_thread
from orbiflow.settings import as_instance, as_points

if TYPE_CHECKING:
    from orbiflow.density.models.conditional import ConditionalDensity

LEVELS = 4
"""Levels of accuracy of kernels that stand for a density; each has a quarter of the error or less."""

BLOCK_POINTS = 2**17
"""Points evaluated by a thread at a time where no gradient is asked for: bounds the memory."""

Pixel = Callable[[Tensor], Tensor]
"""The side of a pixel of a picture at chart points (N, d), in radians: along each axis (d,) of the
frame of a flat space; (N, 1), or the same everywhere (), on a round one."""

KINDS: dict[str, type[Density]] = {}
"""The classes of densities that a file can hold, by the names they have there."""


class Density(WithFigures):
    """A normalised density on an identification space, invariant under the space's group.

    A `torch.distributions.Distribution` over chart points: canonical representatives in [0, 1]^d,
    though any point of an orbit may be given. A `Mixture` of densities is a density again, and any
    density can be a component of one.

    **To add a kind of component**, write a subclass with a `kind`, `log_chart` and `draw`::

        class Bump(Density, kind="bump"):
            ...

    Then it can be evaluated, sampled, drawn and blended. With its tensors named in `stored`, or with
    `header`, `tensors` and `from_header`, it can be saved; with `log_marginal` and `restricted` it has
    marginal and conditional densities.

    Args:
        space: The identification space.
    """

    arg_constraints: ClassVar[dict[str, Any]] = {}  # pyright: ignore[reportIncompatibleMethodOverride]
    has_rsample = True

    kind: ClassVar[str] = ""
    """The name of the class in files and reports; empty for a class that is not saved."""

    article: ClassVar[str] = ""
    """The kind in a sentence, such as "a flow"; default: the kind itself."""

    has_fine_detail: bool = True
    """Whether the density may hold detail that a coarse picture would miss."""

    is_carried: bool = False
    """Whether a flow carries the density's mass to where it is: see `drift`."""

    error: float = 0.0
    """Root mean square difference, in nats, from the density that this one stands for, where it is
    dense; see `orbiflow.density.marginal`."""

    largest_error: float = 0.0
    """The largest difference, in nats, that was found anywhere, also where hardly any mass is."""
    given: ConditionalDensity | None = None
    """Where covariates are known, the density of the same data there; see `DensityEstimator.fit`."""

    _dtype: torch.dtype = torch.float64

    def __init_subclass__(cls, kind: str = "", **options: Any) -> None:
        super().__init_subclass__(**options)
        cls.kind = kind
        if not kind:
            return
        holder = KINDS.setdefault(kind, cls)
        if (holder.__module__, holder.__qualname__) != (cls.__module__, cls.__qualname__):
            raise OrbiflowError(f"the kind {kind!r} is taken by {holder.__name__}: choose another")
        KINDS[kind] = cls

    def __init__(self, space: Space) -> None:
        self.space = as_instance(space, Space, "space", "see `make_space`")
        super().__init__(event_shape=torch.Size([space.chart_dim]), validate_args=False)

    # What a component must say, and what it may.

    def log_chart(self, points: Tensor) -> Tensor:
        """Return log densities (...,) per area of the chart's square, at points (..., d).

        Differentiable in the points, in their dtype. This follows from `log_density` or the other way
        round: a subclass gives one of them.
        """
        values = self.log_density(points)
        return values + self.space.log_kernel_factor(points, CHART)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        """Return `count` random canonical points (count, d), the same on every device."""
        raise NotImplementedError

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        """Return log densities (...,) per area of the sphere on round spaces, else of the square.

        `beside` is the logarithm of a constant density that the caller will add: what is negligible
        beside it may be left out.
        """
        del beside
        values = self.log_chart(points)
        return values - self.space.log_kernel_factor(points, CHART)

    @property
    def log_floor(self) -> float:
        """Logarithm of a constant that the density, as in `log_density`, is never below."""
        return -math.inf

    def parts(self) -> Iterator[tuple[float, Density]]:
        """Yield what the density is a weighted sum of, each with its weight: itself if it is none."""
        yield 1.0, self

    def drift(self, points: Tensor) -> Tensor:
        """Return the time mean of the flow's velocities (..., d) at chart points (..., d), float64."""
        del points
        raise OrbiflowError("the density has no flow: draw another picture of it")

    def bumps(self) -> Tensor:
        """Return chart points (P, d) about which there may be bumps narrower than any grid."""
        return torch.zeros(0, self.space.chart_dim, dtype=torch.float64)

    def is_narrower_than(self, pixel: Pixel) -> bool:
        """Return whether a bump has a deviation below the side of a pixel."""
        del pixel
        return False

    def averaged_over(self, pixel: Pixel) -> Density:
        """Return a density whose bumps are averaged over pixels, the others as they are.

        A bump narrower than a pixel would be seen or missed depending on where a grid falls. Half a
        pixel is added to the deviation of each, in squares: then its values on the grid sum to its mass
        within 2 %, wherever it lies.
        """
        del pixel
        return self

    @classmethod
    def joined(cls, components: Sequence[Any], weights: Tensor) -> Self | None:
        """Return one density of this class that is the mixture of several; None if there is none."""
        del components, weights
        return None

    def mass(self, resolution: int = 64) -> float:
        """Return the integral over the square: 1 for what is normalised in closed form."""
        del resolution
        return 1.0

    # Marginal and conditional densities on tori: see orbiflow.density.inference.

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        """Return log densities (N,) of some angles alone, at points (N, len(axes)) of these in turns.

        `seed` is that of quasi-random nodes, if there are any. Default: what is `restricted`, where
        that has a closed form.
        """
        del seed
        order = sorted(range(len(axes)), key=axes.__getitem__)
        points, kept = points[:, order].double(), [axes[k] for k in order]
        split = Split(self.space.chart_dim, tuple(kept))
        closed, left = self.restricted(split, self.space.of_axes(kept))
        if left:
            raise OrbiflowError(
                f"a {type(self).__name__} cannot be integrated over some of its angles"
            )
        return torch.stack([log + part.log_chart(points) for log, part in closed]).logsumexp(dim=0)

    def restricted(self, split: Split, space: Space) -> Restriction:
        """Return the density of the angles kept, given others, as far as there is a closed form."""
        del space
        return Restriction([], [(0.0, self, split)])

    def approximated(
        self, split: Split, space: Space, level: int, tick: Callable[[], None]
    ) -> list[Weighted] | None:
        """Return kernels that together stand for the density of the angles kept and those given.

        One or two angles are kept. Each level, from 0 to `LEVELS` - 1, is finer than the one before
        it, so that their difference tells the error. `tick` is called now and then. None if there is
        no better way than `log_marginal` on a grid.
        """
        del split, space, level, tick
        return None

    def draw_given(
        self, count: int, given: Mapping[int, float], generator: torch.Generator
    ) -> tuple[Tensor, Tensor]:
        """Return points (count, d) at given angles, and the logarithms (count,) of their weights.

        The mean of the weights is the density of what is given.
        """
        del count, given, generator
        raise OrbiflowError(
            f"a {type(self).__name__} cannot be sampled where some angles are given"
        )

    def effective_share(self) -> float:
        """Return how many weighed draws count, as a share, where samples are chosen among such."""
        return 1.0

    # Saving and loading: see orbiflow.density.models.files.

    stored: ClassVar[tuple[str, ...]] = ()
    """The names of the tensors that make the density again, in the order of the constructor."""

    def header(self) -> dict[str, Any]:
        """Return what makes the density again, together with `tensors`; ready for JSON."""
        return {}

    def tensors(self) -> dict[str, Tensor]:
        """Return the density's tensors by name, in float64."""
        return {name: getattr(self, name).double() for name in self.stored}

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        """Make the density that `header` and `tensors` describe."""
        stored = {name: tensors[name] for name in cls.stored if name in tensors}
        if len(stored) < len(cls.stored) or not all(t.is_floating_point() for t in stored.values()):
            raise OrbiflowError(f"tensors are missing or no floats: wanted {', '.join(cls.stored)}")
        made = cls(space, *stored.values())
        again = made.header()
        if any(header.get(name) != value for name, value in again.items()):
            raise OrbiflowError(f"its tensors are those of {again}, its header says otherwise")
        return made

    # What follows is the same for all densities.

    @property
    def dtype(self) -> torch.dtype:
        """The dtype in which the density is evaluated, and that of samples."""
        return self._dtype

    @property
    def device(self) -> torch.device | None:
        """The device of the density's tensors; None if it has none and works anywhere."""
        return next((v.device for v in vars(self).values() if isinstance(v, Tensor)), None)

    @property
    def support(self) -> Any:  # pyright: ignore[reportIncompatibleMethodOverride]
        """All of R^d: every point stands for its orbit."""
        return constraints.independent(constraints.real, 1)

    @one_thread()
    def log_prob(self, value: Tensor, *, measure: str = CHART) -> Tensor:
        """Return log densities (...,) at chart points (..., d), with respect to `measure`.

        They are evaluated in the density's dtype and returned in that of the points.

        Args:
            value: The points.
            measure: One of `orbiflow.density.MEASURES`; default: area of the square.

        Raises:
            OrbiflowError: for points of another dimension or on another device, points that are not
                finite, or an unknown measure.
        """
        points = self._here(value)
        cast_points = points.to(self.dtype)
        if torch.is_grad_enabled() or cast_points[..., 0].numel() <= BLOCK_POINTS:
            return self._log_prob(cast_points, measure).to(points.dtype)

        @torch.no_grad()
        def evaluate(block: Tensor, _tell: Tell) -> Tensor:
            return self._log_prob(block, measure)

        blocks = torch.split(cast_points.reshape(-1, cast_points.shape[-1]), BLOCK_POINTS)
        with SideBySide() as beside:
            results = [beside.begin(partial(evaluate, block)) for block in blocks]
            values = torch.cat([result() for result in results])
        return values.reshape(cast_points.shape[:-1]).to(points.dtype)

    def _log_prob(self, points: Tensor, measure: str) -> Tensor:
        check_measure(measure)
        if measure == CHART:
            return self.log_chart(points)
        return self.log_density(points) + self.space.log_kernel_factor(points, measure)

    def sample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """Return random canonical points (*sample_shape, d) in the density's dtype.

        Args:
            sample_shape: A shape or a number of points.
            generator: The same state gives the same points. Default: torch's own generator.
        """
        with torch.no_grad():
            return self.rsample(sample_shape, generator)

    @one_thread()
    def rsample(  # pyright: ignore[reportIncompatibleMethodOverride]
        self, sample_shape: Any = (), generator: torch.Generator | None = None
    ) -> Tensor:
        """Return samples as `sample` does, differentiable in the parameters of a flow."""
        shape, source = shape_of(sample_shape), source_of(generator)
        if not shape.numel():
            return torch.empty(*shape, self.space.chart_dim, dtype=self.dtype, device=self.device)
        drawn = self.draw(shape.numel(), source).to(dtype=self.dtype, device=self.device)
        return drawn.reshape(*shape, self.space.chart_dim)

    def to(self, *wanted: Any) -> Self:
        """Return a copy elsewhere: `to("cuda")`, `to(torch.float32)`, `to("cuda", torch.float32)`.

        Or where a tensor is: `to(tensor)`. The dtype is that of evaluation and of a flow's parameters.
        Kernels, chains, networks and weights stay in float64 on any device, as sharp kernels need
        their digits. Samples are drawn on the CPU and moved, so that the same state of a generator
        gives the same points.

        Raises:
            OrbiflowError: for what is neither a device nor a floating dtype.

        >>> from orbiflow.density import UniformDensity, make_space
        >>> single = UniformDensity(make_space("torus")).to(torch.float32)
        >>> single.sample(5).dtype
        torch.float32
        """
        device, dtype = destination(*wanted)
        new = copy.copy(self)
        for name, value in vars(self).items():
            is_density = isinstance(value, Density)
            copied = value.to(device, dtype) if is_density else moved(value, device, dtype)
            setattr(new, name, copied)
        if dtype is not None:
            new._dtype = dtype
        return new

    def _here(self, value: Any) -> Tensor:
        """Return points (..., d) on the density's device; tensors are never moved from another."""
        points, device = as_points(value, self.space.chart_dim), self.device
        if device is None:
            return points
        if not isinstance(value, Tensor):
            return points.to(device)
        if points.device != device:
            raise OrbiflowError(
                f"the points are on {points.device}, the density is on {device}: move one of them, "
                "such as density.to(points.device)"
            )
        return points

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.space!r})"


@dataclass(frozen=True)
class Split:
    """The angles of a torus, of which there are `dim`, in three: kept, given and integrated out.

    `kept` are in the order of the density that is asked for; `values` say where those given are, in
    turns.
    """

    dim: int
    kept: tuple[int, ...]
    given: tuple[int, ...] = ()
    values: tuple[float, ...] = ()

    @property
    def observed(self) -> tuple[int, ...]:
        """The angles kept, then those given."""
        return (*self.kept, *self.given)


Weighted = tuple[float, Density]
"""A density with the logarithm of its weight."""


class Restriction(NamedTuple):
    """A density of some angles, given others, as far as there is a closed form.

    - `closed`: Densities of the angles kept, each with the logarithm of its weight; what is given
      makes these weights, whose sum is the density of what is given.
    - `left`: Densities of all angles that have no closed form, with the logarithms of their weights,
      and how their own angles are split.
    """

    closed: list[Weighted]
    left: list[tuple[float, Density, Split]]
