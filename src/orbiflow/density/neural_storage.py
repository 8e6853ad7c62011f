"""Neural flows and mixture bases as JSON headers and tensors, for `orbiflow.density.storage`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.mixture import SCALES, MixtureBase
from orbiflow.density.neural import MAX_DEPTH, MAX_WAVES, MAX_WIDTH, NeuralFlow, NeuralTorusField
from orbiflow.density.space import Space
from orbiflow.errors import OrbiflowError

MAX_STEPS = 4096
MAX_COMPONENTS = 65536

FLOW, BASE = "flow.", "base."
"""Beginnings of the tensors' names."""


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
    width = _integer(header, "width", MAX_WIDTH)
    depth = _integer(header, "depth", MAX_DEPTH)
    waves = _integer(header, "waves", MAX_WAVES)
    steps = _integer(header, "steps", MAX_STEPS)
    if _integer(header, "dim", space.dim) != space.dim:
        raise OrbiflowError(f"a flow of {header['dim']} angles on a torus of {space.dim}")
    # on the meta device, shapes cost nothing
    with torch.device("meta"):
        field = NeuralTorusField(space.dim, width=width, depth=depth, waves=waves)
    expected = {FLOW + name: value.shape for name, value in field.state_dict().items()}
    found = {name: value for name, value in tensors.items() if name.startswith(FLOW)}
    if expected.keys() != found.keys():
        raise OrbiflowError(f"a neural flow of depth {depth} has {len(expected)} tensors")
    for name, shape in expected.items():
        _checked(name, found[name], shape)
    field.load_state_dict(
        {name.removeprefix(FLOW): value.double() for name, value in found.items()}, assign=True
    )
    for parameter in field.parameters():
        parameter.requires_grad_()
    method = header.get("method")
    if not isinstance(method, str):
        raise OrbiflowError(f"method {method!r}")
    return NeuralFlow(field, steps=steps, method=method)


def mixture_header(base: MixtureBase) -> dict[str, Any]:
    """What, with the tensors of `mixture_tensors`, makes the base again; ready for JSON."""
    return {"kind": "mixture", "components": len(base.concentrations), "scales": list(SCALES)}


def mixture_tensors(base: MixtureBase) -> dict[str, Tensor]:
    """Weights, means, concentrations and orders, float64, by names that begin with "base."."""
    return {
        BASE + "log_weights": base.log_weights,
        BASE + "means": base.means,
        BASE + "concentrations": base.concentrations,
        BASE + "order": base.order.double(),
    }


def mixture_from_header(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], space: Space
) -> MixtureBase:
    """The base of `mixture_header` and `mixture_tensors`, bit for bit.

    Raises:
        OrbiflowError: for tensors that are missing, do not fit or make no distribution.
    """
    count, d = _integer(header, "components", MAX_COMPONENTS), space.dim
    if header.get("scales") != list(SCALES):
        raise OrbiflowError(f"scales {header.get('scales')!r}, expected {list(SCALES)}")
    shapes = {
        "log_weights": (count, len(SCALES)),
        "means": (count, d, 1 + 2 * d),
        "concentrations": (count, d),
        "order": (count, d),
    }
    parts = []
    for name, shape in shapes.items():
        if BASE + name not in tensors:
            raise OrbiflowError(f"the tensor {BASE + name} is missing")
        # a component of no weight has the logarithm -inf
        parts.append(_checked(BASE + name, tensors[BASE + name], shape, least=-math.inf))
    return MixtureBase(space, *parts)


def _checked(name: str, value: Tensor, shape: tuple[int, ...], *, least: float = -1e30) -> Tensor:
    if tuple(value.shape) != tuple(shape):
        raise OrbiflowError(f"{name} has shape {tuple(value.shape)}, expected {tuple(shape)}")
    if not value.is_floating_point() or not bool(((value >= least) & (value < 1e30)).all()):
        raise OrbiflowError(f"{name} has values that are not finite numbers")
    return value


def _integer(header: Mapping[str, Any], name: str, most: int) -> int:
    value = header.get(name)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most:
        raise OrbiflowError(f"{name} must be an integer from 1 to {most}, got {value!r}")
    return value
