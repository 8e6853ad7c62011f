"""Densities of some of a torus' angles: marginal, and conditional on others."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

import torch
from torch import Tensor

from orbiflow.density.arguments import check_kind
from orbiflow.density.inference.axes import (
    Split,
    check_torus,
    given_axes,
    kept_axes,
)
from orbiflow.density.inference.chains import partial_chains
from orbiflow.density.inference.flows import (
    Tabulated,
    partial_kernels,
    tabulated,
)
from orbiflow.density.inference.network import draws_anew
from orbiflow.density.inference.observed import (
    Part,
    part_at,
    parts_of,
)
from orbiflow.density.models import (
    AdaptiveKernels,
    BlendedDensity,
    SymmetricDensity,
    UniformBase,
    VonMisesChains,
    VonMisesNetwork,
    still_flow,
)
from orbiflow.density.spaces import Torus
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import one_thread

MOST_TABULATED = 2
"""Angles of a density that can be tabulated."""

DEAR = {1: 1024, 2: 48}
"""Points along an angle at most where each is an integral of its own, by the number of angles."""

MOST_OFF = 0.5
"""Nats, root mean square, by which what is handed out may be off."""

CHECKED_TWICE = 64
"""Points at which values by quasi-random nodes are compared with those by others."""

FLAT, FLOOR = 1e-6, 1e-9
"""Concentration of a kernel that is as good as uniform; least share of a part."""


def marginal(density: SymmetricDensity, axes: Iterable[int] | int) -> BlendedDensity:
    """The density of some of a torus' angles alone, whatever the others are.

    Kernels and the uniform part are so in closed form, and so are chains that end in the other angles.
    The rest, of one or two angles, is integrated and tabulated: what comes out is exactly normalised,
    and its `error` says by how many nats (root mean square) it is off that which it stands for.

    Args:
        density: of two angles or more.
        axes: numbers of the angles to keep, from 0, in the order that is wanted.

    Raises:
        OrbiflowError: for other spaces, no such angles, or three and more of them where a part has
            no closed form.

    >>> from orbiflow.density import DensityEstimator
    >>> import numpy as np
    >>> rng = np.random.default_rng(0)
    >>> fit = DensityEstimator("torus", parts="kernels").fit(rng.vonmises(0, 4, (60, 2)))
    >>> marginal(fit.density_, [0]).space
    Torus(dim=1, unit='radians')
    """
    space = check_torus(
        check_kind(density, SymmetricDensity, "density").space, "marginal densities"
    )
    return _derived(density, Split(space.dim, kept_axes(axes, space.dim)), space)


def conditional(
    density: SymmetricDensity,
    given: Mapping[int, float],
    axes: Iterable[int] | int | None = None,
) -> BlendedDensity:
    """The density of a torus' other angles where some are known.

    As `marginal`: the parts' conditional densities, each with the share that what is known leaves it.

    Args:
        density: of two angles or more.
        given: values of angles in turns (points of the chart), by the angles' numbers from 0.
        axes: of the other angles, the numbers of those to keep; default all.

    Raises:
        OrbiflowError: for other spaces, no such angles, all angles, or three and more that are left
            where a part has no closed form.
    """
    space = check_torus(
        check_kind(density, SymmetricDensity, "density").space, "conditional densities"
    )
    known, values = given_axes(given, space.dim)
    left = [axis for axis in range(space.dim) if axis not in known]
    kept = kept_axes(left if axes is None else axes, space.dim)
    if set(kept) & set(known):
        raise OrbiflowError(f"axes {sorted(set(kept) & set(known))} are given and cannot be kept")
    return _derived(density, Split(space.dim, kept, known, values), space)


@one_thread()
@torch.no_grad()
def _derived(density: SymmetricDensity, split: Split, torus: Torus) -> BlendedDensity:
    space = Torus(len(split.kept), unit=str(torus.unit))
    kernels: list[tuple[float, AdaptiveKernels]] = []
    chains: tuple[float, VonMisesChains] | None = None
    uniform = -math.inf
    open_: list[tuple[float, Part]] = []
    for share, part in parts_of(density):
        log_share = math.log(share)
        if isinstance(part, UniformBase):
            uniform = log_share
        elif isinstance(part, AdaptiveKernels):
            found, evidence = partial_kernels(part, split, space)
            kernels.append((log_share + evidence, found))
        elif isinstance(part, VonMisesChains):
            closed, log_closed, rest, log_rest = partial_chains(part, split, space)
            if closed is not None:
                chains = (log_share + log_closed, closed)
            if rest is not None:
                open_.append((log_share + log_rest, rest))
        else:
            open_.append((log_share, part))
    if not open_:
        return _blended(space, kernels, uniform, chains)
    table, off = _tabulated(open_, split, space)
    kernels.append((table.log_total, table.kernels))
    found = _blended(space, kernels, uniform, chains)
    closed = [
        uniform,
        *(log for log, _ in kernels[:-1]),
        -math.inf if chains is None else chains[0],
    ]
    share = 1 / (1 + math.exp(torch.tensor(closed).double().logsumexp(0).item() - table.log_total))
    found.error = math.sqrt(share) * max(table.error, off)
    if found.error > MOST_OFF:
        raise OrbiflowError(
            f"the density of these angles can only be had within {found.error:.1f} nats (root mean "
            'square): keep one angle, or fit with --parts kernels,mixture (parts="kernels,mixture")'
        )
    return found


def _tabulated(
    parts: list[tuple[float, Part]], split: Split, space: Torus
) -> tuple[Tabulated, float]:
    """Parts without a closed form as one table, and nats by which its values themselves may be off."""
    if space.dim > MOST_TABULATED:
        kinds = " and ".join(sorted({_kind(part) for _, part in parts}))
        raise OrbiflowError(
            f"a density of {space.dim} angles has no closed form where {kinds} have a share: keep one "
            'or two angles, or fit with --parts kernels,mixture (parts="kernels,mixture")'
        )
    observed = list(split.observed)

    def log_function(points: Tensor, seed: int = 0) -> Tensor:
        whole = split.located(points)
        logs = [log + part_at(part, whole, observed, seed) for log, part in parts]
        return torch.stack(logs).logsumexp(dim=0)

    dear = any(_is_dear(part, split) for _, part in parts)
    table = tabulated(log_function, space, DEAR[space.dim] if dear else None)
    drawn = table.kernels.sample(CHECKED_TWICE, torch.Generator().manual_seed(1))
    twice = log_function(drawn) - log_function(drawn, seed=1)  # where nodes are quasi-random
    return table, float(twice.square().mean().sqrt())


def _is_dear(part: Part, split: Split) -> bool:
    if isinstance(part, VonMisesNetwork):
        return draws_anew(part, list(split.observed), list(split.kept))
    return isinstance(part, SymmetricDensity) and split.dim > len(split.observed)


def _kind(part: Part) -> str:
    if isinstance(part, VonMisesChains):
        return "chains"
    return "a network" if isinstance(part, VonMisesNetwork) else "a flow"


def _blended(
    space: Torus,
    kernels: list[tuple[float, AdaptiveKernels]],
    uniform: float,
    chains: tuple[float, VonMisesChains] | None,
) -> BlendedDensity:
    """One density of parts and the logarithms of their shares, up to a common factor."""
    if not kernels:
        even = torch.full((1, space.dim), FLAT, dtype=torch.float64)
        one = torch.ones(1, dtype=torch.float64)
        uniform -= math.log(2)
        kernels = [(uniform, AdaptiveKernels(space, 0 * even, even, one))]
    logs = torch.tensor([log for log, _ in kernels], dtype=torch.float64)
    within = torch.softmax(logs, dim=0)
    joined = AdaptiveKernels(
        space,
        torch.cat([part.centers for _, part in kernels]),
        torch.cat([part.concentrations for _, part in kernels]),
        torch.cat([part.weights * share for (_, part), share in zip(kernels, within, strict=True)]),
    )
    every = [float(logs.logsumexp(0)), uniform, *([] if chains is None else [chains[0]])]
    shares = torch.softmax(torch.tensor(every, dtype=torch.float64), dim=0).clamp_min(FLOOR)
    shares = torch.cat([shares.new_zeros(1), shares / shares.sum()])
    return BlendedDensity(
        space,
        still_flow(space),
        UniformBase(space),
        joined,
        shares,
        chains=None if chains is None else chains[1],
    )
