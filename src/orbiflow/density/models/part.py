"""Some angles of a density on a torus, where others are given or hidden."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Self

import torch
from torch import Tensor

from orbiflow.arguments import as_instance
from orbiflow.density.models.density import Density, Restriction, Split, Weighted
from orbiflow.density.models.files import density_from, density_parts, within
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import Space, Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import is_list
from orbiflow.typed_torch import listed

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
        whole: A density on a torus.
        split: Which of its angles are kept, given and hidden.
    """

    article = "a part of another density"

    def __init__(self, whole: Density, split: Split) -> None:
        unit = str(as_instance(whole.space, Torus, "the whole's space").unit)
        super().__init__(Torus(len(split.kept), unit=unit))
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
        given = points.new_tensor(self.split.values).expand(len(points), -1)
        observed = [*(self.split.kept[axis] for axis in axes), *self.split.given]
        values = self.whole.log_marginal(torch.cat([points, given], dim=1), observed, seed)
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
        given = dict(zip(self.split.given, self.split.values, strict=True))
        points, logs = self.whole.draw_given(size, given, generator)
        return points, torch.softmax(logs, dim=0)

    def restricted(self, split: Split, space: Torus) -> Restriction:
        own = self._split_of(split)
        closed, left = self.whole.restricted(own, space)
        return Restriction(
            [(log - self.log_given, part) for log, part in closed],
            [(log - self.log_given, part, how) for log, part, how in left],
        )

    def approximated(
        self, split: Split, space: Torus, level: int, tick: Callable[[], None]
    ) -> list[Weighted] | None:
        found = self.whole.approximated(self._split_of(split), space, level, tick)
        return found and [(log - self.log_given, part) for log, part in found]

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
        kept, given = list(self.split.kept), list(self.split.given)
        whole = density_parts(self.whole, "whole")[0]
        return {"dim": self.split.dim, "kept": kept, "given": given, "whole": whole}

    def tensors(self) -> dict[str, Tensor]:
        values = torch.tensor(self.split.values, dtype=torch.float64)
        return {"values": values, **density_parts(self.whole, "whole", "whole.")[1]}

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        dim, kept, given = (header.get(name) for name in ("dim", "kept", "given"))
        values: list[float] = listed(tensors["values"].double())
        axes = [*kept, *given] if is_list(kept) and is_list(given) else []
        if not (
            type(dim) is int
            and all(type(axis) is int and 0 <= axis < dim for axis in axes)
            and len(set(axes)) == len(axes) == space.dim + len(values)
            and all(map(math.isfinite, values))
        ):
            raise OrbiflowError(f"parts {kept!r} and {given!r} of {dim!r} angles")
        whole_space = Torus(dim, unit=str(space.settings().get("unit")))
        whole = density_from(whole_space, header["whole"], within(tensors, "whole."))
        return cls(
            whole, Split(dim, tuple(axes[: space.dim]), tuple(axes[space.dim :]), (*values,))
        )
