"""Mixtures of von Mises chains as a JSON header and tensors."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from torch import Tensor

from orbiflow.density.models.chains import SCALES, VonMisesChains
from orbiflow.density.spaces.space import Space
from orbiflow.density.storage.checks import checked_integer, checked_tensor
from orbiflow.errors import OrbiflowError

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
