"""Families of densities that a fit tries: what is fitted to each fold, and what in the end."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from itertools import compress
from typing import Any, ClassVar, cast

import torch
from torch import Tensor

from orbiflow.density.fitting.chains import (
    FactorShape,
    fit_chain_mixture,
    fit_network,
    network_shapes,
    spread_chains,
)
from orbiflow.density.fitting.held_out import stacking_weights
from orbiflow.density.fitting.kernels import NARROWEST, fit_mixture, kernel_estimates
from orbiflow.density.fitting.parametric import fit_density_of
from orbiflow.density.fitting.product_chains import fit_product_chains
from orbiflow.density.fitting.rows import Rows, gain_of, is_whole, with_incomplete
from orbiflow.density.fitting.tuned_widths import tuned_concentrations
from orbiflow.density.inference import at_observed
from orbiflow.density.models import MOST_DIM, Density, UniformDensity, averaged_networks
from orbiflow.density.spaces import Space, Torus

SIZES = (1, 2, 4, 8, 16, 32, 64)
"""Components of the chains tried, which are more flexible than those of mixtures."""

MIXTURE_SIZES = (*SIZES, 128)
"""Components of the mixtures tried: EM finds 64 bumps by more than 64 components."""

MIXTURE_ROWS, CHAIN_ROWS = 8, 20
"""Rows that each component must have on average."""

SMALLEST_CHAINS = 4
"""The fewest components of chains: fewer are no better than a mixture's."""

MOST_MIXED, MOST_CHAINED = 20_000, 12_000
"""Rows that mixtures and chains are fitted to at most."""

MIN_TELLING_ROWS = 500
"""Rows held out by which kernels without a weight, and without a neighbour of any, are left out; in
more than `MOST_DIM` dimensions all are of use."""

MANY_ROWS, PROMISING_WEIGHT = 20_000, 1e-4
"""Rows from which kernels are judged by all rows held out only if some of these give them a weight."""

CLEARLY_WORSE_ERRORS = 2.0
"""Standard errors by which a larger mixture must be worse to be the last that is tried."""

MAX_ITERATIONS = 60
"""Maximum iterations of EM."""

Say = Callable[[str], None]
"""A function that is called with what is being tried."""


class Family(ABC):
    """Candidates of one class of densities, by their names."""

    name: str

    precedes_floor: bool = False
    """Whether its parts come before the floor: the order of components is that in which samples are
    drawn."""

    kept: int | None = 2
    """How many names go on after the first fold, besides the best alone; None: any number."""

    negligible = 3e-3
    """Weight in the first fold below which they do not."""

    @abstractmethod
    def fitted(self, number: int, train: Rows, held: Rows, say: Say) -> dict[str, Density]:
        """Return what is fitted to the training rows of a fold, to be judged by the rows held out."""

    @abstractmethod
    def final(self, rows: Rows, folds: list[dict[str, Density]], names: list[str]) -> list[Density]:
        """Return what the density is made of, given all rows and what was fitted to each fold."""

    def keep(self, names: set[str]) -> None:
        """Leave out all but `names` from now on, where that saves time."""
        del names


@dataclass
class KernelFamily(Family):
    """Kernel estimates, in the end about all rows."""

    space: Space
    narrowest: float = NARROWEST
    repeats: bool = True
    name = "kernels"
    precedes_floor = True
    # other rows may prefer what has next to no weight, or its neighbours
    kept, negligible = None, 1e-8
    _names: list[str] | None = None
    _tuned: tuple[Tensor | None] | None = None

    def fitted(self, number: int, train: Rows, held: Rows, say: Say) -> dict[str, Density]:
        say("kernels")
        estimates = self._estimates(train, self._names)
        if number == 0 and len(held) >= MIN_TELLING_ROWS and self.space.dim <= MOST_DIM:
            self._names = list(estimates)
            if len(train) >= MANY_ROWS and len(held) >= 2 * MIN_TELLING_ROWS:
                self.keep(self._promising(estimates, held[:MIN_TELLING_ROWS]))
                estimates = {name: estimates[name] for name in self._names}
        return estimates

    def _promising(self, found: dict[str, Density], held: Rows) -> set[str]:
        """Return what has any weight by some of the rows held out, and the best alone."""
        names = [*found, ""]
        logs = {name: at_observed(part, held.points) for name, part in found.items()}
        logs[""] = at_observed(UniformDensity(self.space), held.points)
        weights = stacking_weights(torch.stack([logs[name] for name in names]), held.weights)
        best = max(found, key=lambda name: held.mean(logs[name]))
        kept = zip(names, weights, strict=True)
        return {best, *(name for name, weight in kept if name and weight >= PROMISING_WEIGHT)}

    def final(self, rows: Rows, folds: list[dict[str, Density]], names: list[str]) -> list[Density]:
        del folds
        estimates = self._estimates(rows, names)
        return [estimates[name] for name in names]

    def keep(self, names: set[str]) -> None:
        if (every := self._names) is not None:
            near = [not names.isdisjoint(every[max(0, k - 1) : k + 2]) for k in range(len(every))]
            self._names = list(compress(every, near))

    def _estimates(self, rows: Rows, only: Collection[str] | None) -> dict[str, Density]:
        are_whole = is_whole(rows)
        whole = rows[are_whole]
        if self._tuned is None:  # once: the first rows of all folds are much the same
            self._tuned = (tuned_concentrations(self.space, whole, self.narrowest),)
        estimates = kernel_estimates(
            self.space, whole, narrowest=self.narrowest, repeats=self.repeats, only=only,
            tuned=self._tuned[0],
        )  # fmt: skip
        if len(whole) == len(rows):
            return dict(estimates)
        total = float(len(whole)) if whole.weights is None else float(whole.weights.sum())
        rest = rows[~are_whole]
        return {name: with_incomplete(part, rest, total) for name, part in estimates.items()}


@dataclass
class SizedFamily(Family):
    """Densities of several sizes, in the end the mean of those of all folds.

    By concavity the mean of densities scores at least the mean of their scores, and EM ends in another
    optimum from every start (Breiman, Bagging predictors, 1996).

    - `starts`: How many of each size are fitted to each fold but the first.
    """

    space: Space
    seed: int
    narrowest: float = NARROWEST
    starts: int = 1
    sizes: tuple[int, ...] | None = None

    tried: ClassVar[tuple[int, ...]] = SIZES
    rows_each: ClassVar[int] = CHAIN_ROWS
    most: ClassVar[int] = MOST_CHAINED

    @abstractmethod
    def fit(
        self, size: int, train: Rows, held: Rows, generator: torch.Generator, *, first: bool
    ) -> Density:
        """Return a density of a size; of the `first` fold it is from the first start."""

    def fitted(self, number: int, train: Rows, held: Rows, say: Say) -> dict[str, Density]:
        train = train[: self.most]
        generator = torch.Generator().manual_seed(self.seed + number)

        def fit(size: int, turn: int = 0) -> Density:
            say(f"{self.name} of {size}" + (f", start {turn + 1}" if self.starts > 1 else ""))
            return self.fit(size, train, held, generator, first=number + turn == 0)

        if self.sizes is None:
            whole = int(is_whole(train).sum())
            sizes = [k for k in self.tried if k == 1 or self.rows_each * k <= whole]
            return _grown(fit, sizes, held)
        return {
            str(size): _mean([fit(size, turn) for turn in range(self.starts)])
            for size in self.sizes
        }

    def final(self, rows: Rows, folds: list[dict[str, Density]], names: list[str]) -> list[Density]:
        del rows
        parts = ([fold[name] for fold in folds if name in fold] for name in names)
        return [_mean(of_size) for of_size in parts]

    def keep(self, names: set[str]) -> None:
        self.sizes = tuple(sorted(map(int, names)))


class MixtureFamily(SizedFamily):
    """Mixtures of kernels."""

    name = "mixture"
    precedes_floor = True
    tried, rows_each, most = MIXTURE_SIZES, MIXTURE_ROWS, MOST_MIXED

    def fit(
        self, size: int, train: Rows, held: Rows, generator: torch.Generator, *, first: bool
    ) -> Density:
        del held, first
        return fit_mixture(self.space, train, size, narrowest=self.narrowest, generator=generator)


class ChainFamily(SizedFamily):
    """Mixtures of von Mises chains on a torus.

    Those after the first have their angles in random orders, so that they differ more.
    """

    name = "chains"
    tried = tuple(size for size in SIZES if size >= SMALLEST_CHAINS)

    def fit(
        self, size: int, train: Rows, held: Rows, generator: torch.Generator, *, first: bool
    ) -> Density:
        dim = self.space.dim
        order = torch.arange(dim) if first else torch.randperm(dim, generator=generator)
        start = spread_chains(self.space, train, size, order, generator)
        return fit_chain_mixture(start, train, held, MAX_ITERATIONS)


class ProductChainFamily(SizedFamily):
    """Mixtures of chains on a product: other columns, then a point of its base."""

    name = "chains"

    def fit(
        self, size: int, train: Rows, held: Rows, generator: torch.Generator, *, first: bool
    ) -> Density:
        del held, first
        start = fit_mixture(self.space, train, size, narrowest=self.narrowest, generator=generator)
        return fit_product_chains(start, train, narrowest=self.narrowest)


@dataclass
class ParametricFamily(Family):
    """A parametric family, in the end at its maximum for all rows."""

    space: Space
    name: str

    def fitted(self, number: int, train: Rows, held: Rows, say: Say) -> dict[str, Density]:
        del number, held
        say(self.name)
        return {self.name: fit_density_of(self.space, self.name, train)}

    def final(self, rows: Rows, folds: list[dict[str, Density]], names: list[str]) -> list[Density]:
        del folds
        return [fit_density_of(self.space, self.name, rows) for _ in names]


@dataclass
class NetworkFamily(Family):
    """A Bayesian network on a torus of many angles: its arrows are those that the first fold says."""

    space: Torus
    seed: int
    name = "network"
    _shapes: list[FactorShape] = field(default_factory=list[FactorShape])

    def fitted(self, number: int, train: Rows, held: Rows, say: Say) -> dict[str, Density]:
        train = train[:MOST_CHAINED]
        generator = torch.Generator().manual_seed(self.seed + number)
        if not self._shapes:
            for shape in network_shapes(train, held, generator):
                self._shapes.append(shape)
                say(f"network, angle {len(self._shapes)} of {self.space.dim}")
        say("network")
        return {"network": fit_network(self.space, train, held, self._shapes, generator)}

    def final(self, rows: Rows, folds: list[dict[str, Density]], names: list[str]) -> list[Density]:
        del rows
        return [averaged_networks([cast(Any, fold[name]) for fold in folds]) for name in names]


def _mean(parts: list[Density]) -> Density:
    if len(parts) == 1:
        return parts[0]
    mean = type(parts[0]).joined(parts, torch.ones(len(parts), dtype=torch.float64))
    assert mean is not None
    return mean


def _grown(fit: Callable[[int], Density], sizes: Iterable[int], held: Rows) -> dict[str, Density]:
    """Return fits of growing size, until one is clearly worse on the held-out rows than the best."""
    fits: dict[str, Density] = {}
    best: Tensor | None = None
    for size in sizes:
        part = fits[str(size)] = fit(size)
        with torch.no_grad():
            score = at_observed(part, held.points)
        if best is not None:
            gain = gain_of(score, best, held.weights)
            if gain.nats < -CLEARLY_WORSE_ERRORS * gain.error:
                break
        if best is None or held.mean(score) > held.mean(best):
            best = score
    return fits
