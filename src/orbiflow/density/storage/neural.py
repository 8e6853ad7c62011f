"""Neural flows as a JSON header and tensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from orbiflow.density.models.neural import (
    MAX_DEPTH,
    MAX_WAVES,
    MAX_WIDTH,
    NeuralFlow,
    NeuralTorusField,
)
from orbiflow.density.spaces.space import Space
from orbiflow.density.storage.checks import checked_integer, checked_tensor
from orbiflow.errors import OrbiflowError

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
