"""Densities that are made of others: mixtures, which a fit finds, and some angles of a whole."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Self

import torch
from torch import Tensor

from orbiflow.density.models.density import Density, Pixel, Restriction, Split, Weighted
from orbiflow.density.models.headers import density_from, density_parts, within
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import ProductSpace, Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_list
from orbiflow.settings import as_instance, as_tensor
from orbiflow.typed_torch import listed

MOST_COMPONENTS = 4096
"""The most components that a file may hold."""


class Mixture(Density, kind="mixture"):
    """A weighted sum of densities on one space: exact and normalised, as they are.

    Args:
        components: The densities: of any kind, also mixtures.
        weights: Their weights (P,): positive, of sum 1; kept on the CPU.

    >>> from orbiflow.density import AdaptiveKernels, UniformDensity, make_space
    >>> space, one = make_space("torus"), torch.ones(1)
    >>> kernel = AdaptiveKernels(space, torch.tensor([[0.5, 0.5]]), torch.tensor([[4.0, 9.0]]), one)
    >>> Mixture([kernel, UniformDensity(space)], [0.75, 0.25])
    Mixture(Torus(axes=2, unit='radians'), kernels 75.0%, uniform 25.0%)
    """

    def __init__(self, components: Sequence[Density], weights: Any) -> None:
        if not components:
            raise OrbiflowError("components must be one density or more")
        for component in components:
            as_instance(component, Density, "each of the components")
        super().__init__(components[0].space)
        self.components = tuple(components)
        weights = as_tensor(weights, "weights").detach().double().cpu()
        if (
            weights.shape != (len(self.components),)
            or not bool((weights > 0).all())
            or abs(float(weights.sum()) - 1) > 1e-6
        ):
            raise OrbiflowError(
                f"weights must be {len(self.components)} positive numbers of sum 1, got "
                f"{listed(weights)}"
            )
        self.weights = weights

    @property
    def dtype(self) -> torch.dtype:
        """The coarsest dtype of the components."""
        return min((part.dtype for part in self.components), key=lambda t: torch.finfo(t).bits)

    @property
    def device(self) -> torch.device | None:
        """The device of the components; None if they work anywhere."""
        return next((part.device for part in self.components if part.device is not None), None)

    @property
    def weight_of_kind(self) -> dict[str, float]:
        """The weight of each kind of component."""
        weights: dict[str, float] = {}
        for component, weight in zip(self.components, listed(self.weights), strict=True):
            name = component.kind or type(component).__name__
            weights[name] = weights.get(name, 0.0) + weight
        return weights

    @property
    def has_fine_detail(self) -> bool:  # pyright: ignore[reportIncompatibleVariableOverride]
        """Whether a component has."""
        return any(component.has_fine_detail for component in self.components)

    @property
    def log_floor(self) -> float:
        floors = [log + component.log_floor for log, component in self._weighted()]
        return torch.tensor(floors, dtype=torch.float64).logsumexp(0).item()

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        floor = float(torch.logaddexp(*torch.tensor([self.log_floor, beside], dtype=torch.float64)))
        return _log_sum(
            [
                component.log_density(points, floor - log) + log
                for log, component in self._weighted()
            ]
        )

    def parts(self) -> Iterator[tuple[float, Density]]:
        for weight, component in zip(listed(self.weights), self.components, strict=True):
            yield from ((weight * share, part) for share, part in component.parts())

    def averaged_over(self, pixel: Pixel) -> Self:
        return self._with(component.averaged_over(pixel) for component in self.components)

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        chosen = torch.multinomial(self.weights, count, replacement=True, generator=generator)
        counts: list[int] = listed(torch.bincount(chosen, minlength=len(self.components)))
        drawn = torch.empty(count, self.space.chart_dim, dtype=self.dtype, device=self.device)
        for index, (number, component) in enumerate(zip(counts, self.components, strict=True)):
            if number:
                at = torch.nonzero(chosen == index)[:, 0].to(drawn.device)
                drawn = drawn.index_put((at,), component.draw(number, generator).to(drawn))
        return drawn

    def mass(self, resolution: int = 64) -> float:
        """Return the integral over the square: only that of a flow may be off 1."""
        pairs = zip(listed(self.weights), self.components, strict=True)
        return 1 + sum(weight * (component.mass(resolution) - 1) for weight, component in pairs)

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        table = [part.log_marginal(points, axes, seed) + log for log, part in self._weighted()]
        return torch.stack(table).logsumexp(dim=0)

    def restricted(self, split: Split, space: Space) -> Restriction:
        whole = Restriction([], [])
        for log, component in self._weighted():
            closed, left = component.restricted(split, space)
            whole.closed.extend((log + more, density) for more, density in closed)
            whole.left.extend((log + more, part, own_split) for more, part, own_split in left)
        return whole

    def to(self, *wanted: Any) -> Self:
        return self._with(component.to(*wanted) for component in self.components)

    def _with(self, components: Iterable[Density]) -> Self:
        new = copy.copy(self)
        new.components = tuple(components)
        return new

    def header(self) -> dict[str, Any]:
        named = (
            (part, part.article or part.kind or type(part).__name__) for part in self.components
        )
        parts = [density_parts(part, name, space=self.space) for part, name in named]
        return {"components": [header for header, _ in parts]}

    def tensors(self) -> dict[str, Tensor]:
        named = {"weights": self.weights}
        for number, component in enumerate(self.components):
            named |= density_parts(component, "component", f"{number}.")[1]
        return named

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        headers = header["components"]
        if not is_list(headers) or not 1 <= len(headers) <= MOST_COMPONENTS:
            raise OrbiflowError("no components, or too many")
        components = [
            density_from(space, entry, within(tensors, f"{number}."))
            for number, entry in enumerate(headers)
        ]
        return cls(components, tensors["weights"])

    def _weighted(self) -> list[tuple[float, Density]]:
        """Return the components, each with the logarithm of its weight."""
        return list(zip(listed(self.weights.log()), self.components, strict=True))

    def __repr__(self) -> str:
        parts = [f"{name} {100 * weight:.1f}%" for name, weight in self.weight_of_kind.items()]
        return f"Mixture({self.space!r}, {', '.join(parts)})"


def mixture_of(weighted: Sequence[tuple[float, Density]]) -> Mixture:
    """Return the mixture of weighted densities, those of a kind in one component where it can.

    Components are in the order in which their kinds come first; weights of any sum.
    """
    groups: dict[type[Density], list[tuple[float, Density]]] = {}
    for weight, density in weighted:
        groups.setdefault(type(density), []).append((weight, density))
    parts: list[tuple[float, Density]] = []
    for kind, group in groups.items():
        weights = torch.tensor([weight for weight, _ in group], dtype=torch.float64)
        joined = kind.joined([density for _, density in group], weights)
        parts += group if joined is None else [(float(weights.sum()), joined)]
    weights = torch.tensor([weight for weight, _ in parts], dtype=torch.float64)
    return Mixture([density for _, density in parts], weights / weights.sum())


def _log_sum(logs: list[Tensor]) -> Tensor:
    total = logs[0]
    for more in logs[1:]:
        total = torch.logaddexp(total, more)
    return total


MIN_DRAWS, MAX_DRAWS = 2**14, 2**20
"""The fewest and the most weighed draws of which samples are chosen."""

DRAWS_PER_SAMPLE = 32
"""Weighed draws for each sample."""

BLOCK_POINTS = 2**10
"""Points evaluated at a time."""


class PartialDensity(Density, kind="partial"):
    """The density of some of the angles of another one, where others are given.

    Log densities are integrals over the hidden angles, as the whole's component takes them. Samples are
    the whole's where nothing is given. Otherwise they are chosen among weighed draws (importance
    resampling: Rubin, 1987), of which `effective_share` says how many count.

    Args:
        whole: A density on a torus, or on a product.
        split: Which of its coordinates are kept, given and hidden.
    """

    article = "a part of another density"

    def __init__(self, whole: Density, split: Split) -> None:
        super().__init__(whole.space.of_axes(split.kept))
        self.whole, self.split = whole, split
        self.log_given = 0.0
        if split.given:
            at = torch.tensor([split.values], dtype=torch.float64)
            self.log_given = float(whole.log_marginal(at, list(split.given)))

    @property
    def device(self) -> torch.device | None:
        """The device of the whole."""
        return self.whole.device

    def log_chart(self, points: Tensor) -> Tensor:
        return in_blocks(
            lambda p: self.log_marginal(p, list(range(p.shape[1]))), points, BLOCK_POINTS
        )

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        values_given = points.new_tensor(self.split.values).expand(len(points), -1)
        observed = [*(self.split.kept[axis] for axis in axes), *self.split.given]
        values = self.whole.log_marginal(torch.cat([points, values_given], dim=1), observed, seed)
        return values - self.log_given

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        kept = list(self.split.kept)
        if not self.split.given:
            return self.whole.draw(count, generator)[:, kept]
        size = min(MAX_DRAWS, max(MIN_DRAWS, DRAWS_PER_SAMPLE * count))
        points, weights = self._pool(size, generator)
        # the points are split evenly: none comes more often than its weight makes it
        at = (torch.arange(count) + torch.rand(1, generator=generator)) / count
        chosen = torch.searchsorted(weights.cumsum(0), at.double()).clamp_max(size - 1)
        return points[chosen[torch.randperm(count, generator=generator)]][:, kept]

    def effective_share(self) -> float:
        if not self.split.given:
            return 1.0
        weights = self._pool(MIN_DRAWS, torch.Generator().manual_seed(0))[1]
        return 1 / float(weights.square().sum()) / MIN_DRAWS

    def _pool(self, size: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Return draws (size, d) of all angles, and weights (size,) of sum 1."""
        fixed = dict(zip(self.split.given, self.split.values, strict=True))
        points, logs = self.whole.draw_given(size, fixed, generator)
        return points, torch.softmax(logs, dim=0)

    def restricted(self, split: Split, space: Space) -> Restriction:
        split_of_whole = self._split_of(split)
        closed, left = self.whole.restricted(split_of_whole, space)
        return Restriction(
            [(log - self.log_given, part) for log, part in closed],
            [(log - self.log_given, part, how) for log, part, how in left],
        )

    def approximated(
        self, split: Split, space: Space, level: int, tick: Callable[[], None]
    ) -> list[Weighted] | None:
        kernels = self.whole.approximated(self._split_of(split), space, level, tick)
        return kernels and [(log - self.log_given, part) for log, part in kernels]

    def _split_of(self, split: Split) -> Split:
        """Return how the whole's angles are split, if those kept here are split again."""
        kept = self.split.kept
        return Split(
            self.split.dim,
            tuple(kept[axis] for axis in split.kept),
            (*(kept[axis] for axis in split.given), *self.split.given),
            (*split.values, *self.split.values),
        )

    def to(self, *wanted: Any) -> Self:
        new = super().to(*wanted)
        new.whole = self.whole.to(*wanted)
        return new

    def header(self) -> dict[str, Any]:
        kept, fixed = list(self.split.kept), list(self.split.given)
        whole = density_parts(self.whole, "whole")[0]
        axes = self.whole.space.settings().get("axes")
        space: dict[str, Any] = {} if axes is None else {"axes": axes}
        if self.whole.space.parts:
            space = {"space": self.whole.space.settings()}
        return {"dim": self.split.dim, "kept": kept, "given": fixed, "whole": whole, **space}

    def tensors(self) -> dict[str, Tensor]:
        values = torch.tensor(self.split.values, dtype=torch.float64)
        return {"values": values, **density_parts(self.whole, "whole", "whole.")[1]}

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        dim, kept, fixed = (header.get(name) for name in ("dim", "kept", "given"))
        values: list[float] = listed(tensors["values"].double())
        axes = [*kept, *fixed] if is_list(kept) and is_list(fixed) else []
        if not (
            type(dim) is int
            and all(type(axis) is int and 0 <= axis < dim for axis in axes)
            and len(set(axes)) == len(axes) == space.chart_dim + len(values)
            and all(map(math.isfinite, values))
        ):
            raise OrbiflowError(f"parts {kept!r} and {fixed!r} of {dim!r} angles")
        unit, lines = str(space.settings().get("unit")), header.get("axes")
        whole_space: Space = Torus(dim if lines is None else lines, unit=unit)
        if "space" in header:
            whole_space = ProductSpace(**header["space"])
        if whole_space.chart_dim != dim or whole_space.of_axes(axes[: space.chart_dim]) != space:
            raise OrbiflowError(f"columns {lines!r} of {dim!r}")
        whole = density_from(whole_space, header["whole"], within(tensors, "whole."))
        return cls(
            whole,
            Split(dim, tuple(axes[: space.chart_dim]), tuple(axes[space.chart_dim :]), (*values,)),
        )
