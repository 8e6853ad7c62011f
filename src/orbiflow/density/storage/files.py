"""A fitted density as bytes: safetensors, never pickle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.models import (
    AdaptiveKernels,
    Base,
    BlendedDensity,
    NeuralFlow,
    SymmetricDensity,
    UniformBase,
    VonMisesBase,
    VonMisesChains,
)
from orbiflow.density.spaces import Space, make_space
from orbiflow.density.storage.components import (
    BESIDE,
    chains_from_header,
    chains_header,
    chains_tensors,
    network_from_header,
    network_header,
    network_tensors,
    neural_from_header,
    neural_header,
    neural_tensors,
)
from orbiflow.density.storage.series import (
    check_group,
    is_same_group,
    series_from_header,
    series_parts,
)
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes
from orbiflow.symmetry import group_header

FORMATS = tuple(f"orbiflow-density/{number}" for number in (1, 2, 3, 4))
"""Read: the first had one smoothness for all segments, and no group; the second no chains beside a
flow; the third no network. A density is written in the first of the last three that can hold it."""

MAX_KERNELS = 1_000_000


def density_to_bytes(density: SymmetricDensity, **extra: Any) -> bytes:
    """A density as bytes that `read_density` makes the same again, with `extra` JSON for the reader.

    Saved are flows of Fourier, spline and neural fields on the space's own group, uniform, von Mises
    and chain bases, kernels, chains and networks. Parameters are written in float64.

    Raises:
        OrbiflowError: naming the part that cannot be saved, rather than save another density.
    """
    if type(density) not in (SymmetricDensity, BlendedDensity):
        raise OrbiflowError(
            f"the density is a {type(density).__name__}, which a file does not hold: save the "
            "SymmetricDensity or BlendedDensity that it is made of"
        )
    space = _checked_space(density.space)
    base, tensors = _base_parts(density)
    flow, more = _flow_parts(density)
    tensors |= more
    if isinstance(density, BlendedDensity):
        tensors |= _kernel_tensors(density)
    chains, network = None, None
    if isinstance(density, BlendedDensity):
        chains, network = density.chains, density.network
    if chains is not None:
        _check_shared_space(density, chains, "mixture of chains")
        tensors |= chains_tensors(chains, BESIDE)
    if network is not None:
        _check_shared_space(density, network, "network")
        tensors |= network_tensors(network)
    header = {
        "format": FORMATS[1 if chains is None else 2] if network is None else FORMATS[3],
        "space": {"name": space.name, **space.settings()},
        "group": group_header(space.group),
        "base": base,
        "flow": flow,
        "extra": extra,
    }
    if chains is not None:
        header["chains"] = chains_header(chains)
    if network is not None:
        header["network"] = network_header(network)
    return tensor_bytes(header, tensors, "a density")


def _checked_space(space: Space) -> Space:
    """The space, known to be made again by its name and settings."""
    try:
        again = make_space(space.name, **space.settings())
    except OrbiflowError:
        again = None
    if (
        again is None
        or type(again) is not type(space)
        or not is_same_group(again.group, space.group)
    ):
        raise OrbiflowError(
            f"the space is a {type(space).__name__}, which `make_space` does not make: save densities "
            "on the four spaces as they are"
        )
    return space


def _check_shared_space(density: SymmetricDensity, part: Base, name: str) -> None:
    one, other = ((s.name, s.settings()) for s in (density.space, part.space))
    if one != other:
        raise OrbiflowError(
            f"the {name} is on {part.space!r}, the density on {density.space!r}: make both on one"
        )


def _base_parts(density: SymmetricDensity) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Header and tensors of a base."""
    base = density.base
    _check_shared_space(density, base, "base")
    if type(base) is UniformBase:
        return {"kind": "uniform"}, {}
    if type(base) is VonMisesBase:
        return {"kind": "von-mises", "concentration": base.concentration}, {}
    if type(base) is VonMisesChains:
        return chains_header(base), chains_tensors(base)
    raise OrbiflowError(
        f"the base is a {type(base).__name__}: only UniformBase, VonMisesBase and VonMisesChains are "
        "saved; save its parameters yourself"
    )


def _flow_parts(density: SymmetricDensity) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Header and tensors of a flow."""
    flow = density.flow
    if type(flow) is NeuralFlow:
        return neural_header(flow), neural_tensors(flow)
    return series_parts(flow, density.space)


def _kernel_tensors(density: BlendedDensity) -> dict[str, Tensor]:
    kernels = density.kernels
    _check_shared_space(density, kernels, "mixture of kernels")
    if type(kernels) is not AdaptiveKernels or len(kernels.centers) > MAX_KERNELS:
        raise OrbiflowError(
            f"the kernels are {len(kernels.centers)} of {type(kernels).__name__}: only "
            f"AdaptiveKernels are saved, {MAX_KERNELS} at most"
        )
    return {
        "kernel_centers": kernels.centers,
        "kernel_concentrations": kernels.concentrations,
        "kernel_weights": kernels.weights,
        "shares": density.shares,
    }


def read_density(path: str | Path) -> tuple[SymmetricDensity, dict[str, Any]]:
    """A saved density, float64, and what was saved with it; files of version 0.1 as well.

    Raises:
        InputFileError: if the file is missing, too large, damaged or of another kind.
    """
    header, tensors = read_tensors(path, "a density")
    try:
        if header["format"] not in FORMATS:
            raise ValueError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            return _restored(header, tensors), header["extra"]
    except (OrbiflowError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputFileError(
            f"{path}: not a density saved by orbiflow, or damaged ({error})"
        ) from error


def _restored(header: dict[str, Any], tensors: dict[str, Tensor]) -> SymmetricDensity:
    options = dict(header["space"])
    space = make_space(str(options.pop("name")), **options)
    if header["format"] != FORMATS[0]:
        check_group(header["group"], space.group)
    neural = header["flow"]["kind"] == "neural"
    flow = (neural_from_header if neural else series_from_header)(header["flow"], tensors, space)
    base = _restored_base(header["base"], tensors, space)
    if "shares" not in tensors:
        return SymmetricDensity(space, flow, base)
    parts = [tensors[f"kernel_{name}"] for name in ("centers", "concentrations", "weights")]
    if len(parts[0]) > MAX_KERNELS:
        raise ValueError(f"{len(parts[0])} kernels")
    chains = header.get("chains")
    if chains is not None:
        chains = chains_from_header(chains, tensors, space, BESIDE)
    network = header.get("network")
    if network is not None:
        network = network_from_header(network, tensors, space)
    kernels = AdaptiveKernels(space, *parts)
    shares = tensors["shares"]
    return BlendedDensity(space, flow, base, kernels, shares, chains=chains, network=network)


def _restored_base(header: dict[str, Any], tensors: dict[str, Tensor], space: Space) -> Base:
    kind = header["kind"]
    if kind == "uniform":
        return UniformBase(space)
    if kind == "von-mises":
        return VonMisesBase(space, float(header["concentration"]))
    if kind == "mixture":
        return chains_from_header(header, tensors, space)
    raise ValueError(f"a base of kind {kind!r}")
