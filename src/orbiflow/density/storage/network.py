"""Bayesian networks of angles as a JSON header and tensors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from torch import Tensor

from orbiflow.density.models.network import Factor, VonMisesNetwork
from orbiflow.density.spaces.flat import Torus
from orbiflow.density.spaces.space import Space
from orbiflow.density.storage.chains import chains_from_header, chains_header, chains_tensors
from orbiflow.errors import OrbiflowError
from orbiflow.json_values import is_list, is_object


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
