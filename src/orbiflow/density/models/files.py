"""Densities on disk: safetensors, never pickle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from orbiflow.arguments import as_instance
from orbiflow.density.models.chains import VonMisesChains
from orbiflow.density.models.density import Density
from orbiflow.density.models.flow import FlowDensity, UniformDensity
from orbiflow.density.models.headers import (
    check_group,
    density_from,
    density_parts,
    is_same_group,
    within,
)
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.mixture import Mixture
from orbiflow.density.models.network import VonMisesNetwork
from orbiflow.density.spaces import Space, make_space
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes
from orbiflow.symmetry import group_header
from orbiflow.typed_torch import listed

FORMAT = "orbiflow-density/5"

FORMATS_BEFORE = tuple(f"orbiflow-density/{number}" for number in (1, 2, 3, 4))
"""Formats of version 0.1, which are read: the first has one smoothness for all segments, and no group;
the second no chains beside a flow; the third no network."""


def density_to_bytes(density: Density, **extra: Any) -> bytes:
    """Return a density as bytes that `read_density` makes the same again.

    Saved are densities whose class has a `kind`, on the four spaces as `make_space` makes them, and
    flows of Fourier and spline fields on the space's own group; anything else is refused by the name of
    the part. Parameters are written in float64. `extra` are further values for the reader, for JSON.
    """
    header, tensors = density_parts(as_instance(density, Density, "density"), "density")
    space = _checked_space(density.space)
    document = {
        "format": FORMAT,
        "space": {"name": space.name, **space.settings()},
        "group": group_header(space.group),
        "density": header,
        "extra": extra,
    }
    return tensor_bytes(document, tensors, "a density")


def _checked_space(space: Space) -> Space:
    """Return the space if its name and settings make it again."""
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


def read_density(path: str | Path) -> tuple[Density, dict[str, Any]]:
    """Return a saved density, float64, and what was saved with it; files of version 0.1 as well."""
    header, tensors = read_tensors(path, "a density")
    try:
        if header["format"] not in (FORMAT, *FORMATS_BEFORE):
            raise ValueError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            return _restored(header, tensors), header["extra"]
    except _NeuralFlowError as error:
        raise InputFileError(f"{path}: {error}") from error
    except (OrbiflowError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputFileError(
            f"{path}: not a density saved by orbiflow, or damaged ({error})"
        ) from error


def _restored(header: dict[str, Any], tensors: dict[str, Tensor]) -> Density:
    options = dict(header["space"])
    space = make_space(str(options.pop("name")), **options)
    if header["format"] != FORMATS_BEFORE[0]:
        check_group(header["group"], space.group)
    if header["format"] == FORMAT:
        return density_from(space, header["density"], tensors)
    return _of_version_0_1(space, header, tensors)


class _NeuralFlowError(OrbiflowError):
    """A file of version 0.1 holds a neural flow."""


def _of_version_0_1(space: Space, header: dict[str, Any], tensors: dict[str, Tensor]) -> Density:
    """Make a density of a file with a flow and a base and, if it has weights, other components.

    A density without a flow had one of weight 0, which is left out.
    """
    weights: list[float] = listed(tensors["shares"]) if "shares" in tensors else [1.0]
    components: list[Density] = []
    if weights[0] > 0:
        components.append(_flow_of_version_0_1(space, header, tensors))
    if "shares" not in tensors:
        return components[0]
    kernels = [tensors[f"kernel_{name}"] for name in ("centers", "concentrations", "weights")]
    components += [AdaptiveKernels(space, *kernels), UniformDensity(space)]
    if header.get("chains") is not None:
        own = within(tensors, "chains.")
        components.append(VonMisesChains.from_header(space, header["chains"], own))
    if header.get("network") is not None:
        own = within(tensors, "network.")
        components.append(VonMisesNetwork.from_header(space, header["network"], own))
    return Mixture(components, tensors["shares"][tensors["shares"] > 0])


def _flow_of_version_0_1(
    space: Space, header: dict[str, Any], tensors: dict[str, Tensor]
) -> Density:
    base = dict(header["base"])
    if base["kind"] == "mixture":
        base["kind"] = "chains"
    if header["flow"]["kind"] == "neural":
        if any(bool(t.any()) for name, t in tensors.items() if name.startswith("flow.last.")):
            raise _NeuralFlowError(
                f"it holds a neural flow on a torus of {space.dim} angles, which orbiflow has no "
                "longer: fit the data again without one, or use this file with orbiflow 0.1"
            )
        # the field is zero, and the density that of its base
        return density_from(space, base, within(tensors, "base."))
    return FlowDensity.from_header(space, {**header, "base": base}, tensors)
