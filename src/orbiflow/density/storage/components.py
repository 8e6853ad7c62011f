"""Mixtures of von Mises chains as a JSON header and tensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.models import (
    SCALES,
    Factor,
    NeuralFlow,
    VonMisesChains,
    VonMisesNetwork,
)
from orbiflow.density.spaces import Space, Torus
from orbiflow.density.storage.series import checked_integer, checked_tensor
from orbiflow.errors import OrbiflowError
from orbiflow.fields import (
    MAX_DEPTH,
    MAX_WAVES,
    MAX_WIDTH,
    NeuralTorusField,
)
from orbiflow.runtime import is_list, is_object

MAX_COMPONENTS = 65536

BASE, BESIDE = "base.", "chains."
"""Beginning of the tensors' names, of a base and of what is beside a flow."""


def chains_header(base: VonMisesChains) -> dict[str, Any]:
    """What, with the tensors of `chains_tensors`, makes the base again; ready for JSON."""
    return {"kind": "mixture", "components": len(base.concentrations), "scales": list(SCALES)}


def chains_tensors(base: VonMisesChains, prefix: str = BASE) -> dict[str, Tensor]:
    """Weights, means, concentrations and orders, float64, by names that begin with `prefix`."""
    return {
        prefix + "log_weights": base.log_weights,
        prefix + "means": base.means,
        prefix + "concentrations": base.concentrations,
        prefix + "order": base.order.double(),
    }


def chains_from_header(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], space: Space, prefix: str = BASE
) -> VonMisesChains:
    """The base of `chains_header` and `chains_tensors`, bit for bit.

    Raises:
        OrbiflowError: for tensors that are missing, do not fit or make no distribution.
    """
    count, d = checked_integer(header, "components", MAX_COMPONENTS), space.dim
    if header.get("scales") != list(SCALES):
        raise OrbiflowError(f"scales {header.get('scales')!r}, expected {list(SCALES)}")
    shapes = {
        "log_weights": (count, len(SCALES)),
        "means": (count, d, 1 + 2 * d),
        "concentrations": (count, d),
        "order": (count, d),
    }
    parts: list[Tensor] = []
    for name, shape in shapes.items():
        if prefix + name not in tensors:
            raise OrbiflowError(f"the tensor {prefix + name} is missing")
        # a component of no weight has the logarithm -inf
        parts.append(checked_tensor(prefix + name, tensors[prefix + name], shape, least=-math.inf))
    return VonMisesChains(space, *parts)


def network_header(network: VonMisesNetwork) -> dict[str, Any]:
    """What, with the tensors of `network_tensors`, makes the network again; ready for JSON."""
    return {
        "factors": [
            {"axes": list(axes), **chains_header(chains)} for axes, chains in network.factors
        ]
    }


def network_tensors(network: VonMisesNetwork) -> dict[str, Tensor]:
    """The tensors of all factors, by names that begin with the number of their angle."""
    found: dict[str, Tensor] = {}
    for axes, chains in network.factors:
        found |= chains_tensors(chains, _prefix(axes[-1]))
    return found


def network_from_header(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], space: Space
) -> VonMisesNetwork:
    """The network of `network_header` and `network_tensors`, bit for bit.

    Raises:
        OrbiflowError: for tensors that are missing, do not fit or make no distribution.
    """
    factors: list[Factor] = []
    stored: Any = header.get("factors")
    if not is_list(stored) or len(stored) != space.dim or not all(map(is_object, stored)):
        raise OrbiflowError(f"a network of {space.dim} angles needs a factor for each")
    for own in stored:
        found: Any = own.get("axes")
        if not is_list(found) or not 0 < len(found) <= space.dim:
            raise OrbiflowError(f"a factor of the angles {found!r}")
        if not all(type(axis) is int and 0 <= axis < space.dim for axis in found):
            raise OrbiflowError(f"a factor of the angles {found!r}")
        axes: tuple[int, ...] = tuple(found)
        chains = chains_from_header(own, tensors, Torus(len(axes)), _prefix(axes[-1]))
        factors.append(Factor(axes, chains))
    return VonMisesNetwork(space, factors)


def _prefix(axis: int) -> str:
    return f"network.{axis}."


MAX_STEPS = 4096

FLOW = "flow."
"""Beginning of the tensors' names."""


def neural_header(flow: NeuralFlow) -> dict[str, Any]:
    """What, with the tensors of `neural_tensors`, makes the flow again; ready for JSON."""
    field = flow.field
    return {
        "kind": "neural",
        "dim": field.dim,
        "width": field.width,
        "depth": field.depth,
        "waves": field.waves,
        "steps": flow.steps,
        "method": flow.method,
    }


def neural_tensors(flow: NeuralFlow) -> dict[str, Tensor]:
    """The weights, float64, by names that begin with "flow."."""
    return {
        FLOW + name: value.detach().double().cpu().contiguous()
        for name, value in flow.field.state_dict().items()
    }


def neural_from_header(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], space: Space
) -> NeuralFlow:
    """The flow of `neural_header` and `neural_tensors`, float64, bit for bit.

    Sizes are checked against the tensors at hand before a network is made, so that a hostile header
    cannot ask for memory that its file does not have.

    Raises:
        OrbiflowError: for sizes out of range, of another space, or tensors that do not fit.
    """
    width = checked_integer(header, "width", MAX_WIDTH)
    depth = checked_integer(header, "depth", MAX_DEPTH)
    waves = checked_integer(header, "waves", MAX_WAVES)
    steps = checked_integer(header, "steps", MAX_STEPS)
    if checked_integer(header, "dim", space.dim) != space.dim:
        raise OrbiflowError(f"a flow of {header['dim']} angles on a torus of {space.dim}")
    # on the meta device, shapes cost nothing
    with torch.device("meta"):
        field = NeuralTorusField(space.dim, width=width, depth=depth, waves=waves)
    expected = {FLOW + name: value.shape for name, value in field.state_dict().items()}
    found = {name: value for name, value in tensors.items() if name.startswith(FLOW)}
    if expected.keys() != found.keys():
        raise OrbiflowError(f"a neural flow of depth {depth} has {len(expected)} tensors")
    for name, shape in expected.items():
        checked_tensor(name, found[name], shape)
    field.load_state_dict(
        {name.removeprefix(FLOW): value.double() for name, value in found.items()}, assign=True
    )
    for parameter in field.parameters():
        parameter.requires_grad_()
    method = header.get("method")
    if not isinstance(method, str):
        raise OrbiflowError(f"method {method!r}")
    return NeuralFlow(field, steps=steps, method=method)
