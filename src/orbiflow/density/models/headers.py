"""JSON headers and tensors of spaces and densities, which make them again."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from torch import Tensor

from orbiflow.density.models.density import KINDS, Density
from orbiflow.density.spaces import Space, make_space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_number
from orbiflow.symmetry import CrystallographicGroup, group_header


def space_header(space: Space) -> dict[str, Any]:
    """Return what `space_from` makes a space of again, for JSON; refuse other spaces."""
    try:
        again = make_space(space.name, **space.settings())
    except OrbiflowError:
        again = None
    if (
        again is None
        or type(again) is not type(space)
        or again.settings() != space.settings()
        or (space.has_chart and not is_of_group(group_header(again.group), space.group))
    ):
        raise OrbiflowError(
            f"the space is a {type(space).__name__}, which `make_space` does not make again: give the "
            'class a name of its own, `name = "..."`, and settings that are its options'
        )
    return {
        "space": {"name": space.name, **space.settings()},
        "group": group_header(space.group) if space.has_chart else None,
    }


def space_from(header: Mapping[str, Any]) -> Space:
    """Make the space of `space_header` again."""
    options = dict(header["space"])
    space = make_space(str(options.pop("name")), **options)
    if space.has_chart and not is_of_group(header["group"], space.group):
        raise OrbiflowError(f"its group is not {space.group!r}, which its space has here")
    return space


def known_kinds() -> None:
    """Import the modules of all kinds of densities that files may hold."""
    for module in ("mixture", "network", "fisher_bingham", "sine", "product_chains"):
        import_module(f"orbiflow.density.models.{module}")


def density_parts(
    density: Density, name: str, prefix: str = "", space: Space | None = None
) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return a density's header and its tensors, whose names begin with `prefix`.

    `name` is what it is in messages, such as "base"; a component must be on the whole's `space`.
    """
    kind = type(density).kind
    if KINDS.get(kind) is not type(density):
        raise OrbiflowError(
            f"the {name} is a {type(density).__name__}, which a file does not hold: save a density of "
            f"one of the kinds {', '.join(sorted(KINDS))}, or give the class a kind, "
            f'class {type(density).__name__}(Density, kind="...")'
        )
    there = density.space
    if space is not None and space != there:
        raise OrbiflowError(
            f"the {name} is on {there!r}, the density on {space!r}: make both on one space"
        )
    tensors = {prefix + key: tensor for key, tensor in density.tensors().items()}
    names = ("error", "largest_error")
    error = {name: getattr(density, name) for name in names if getattr(density, name)}
    return {"kind": kind, **error, **density.header()}, tensors


def density_from(space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Density:
    """Make the density of `density_parts` again, bit for bit."""
    kind = header["kind"]
    if kind not in KINDS:
        raise OrbiflowError(
            f"a density of the kind {kind!r} is not known here: import the module that defines it"
        )
    made = KINDS[kind].from_header(space, header, tensors)
    made.error = as_number(header.get("error", 0.0), "error")
    made.largest_error = as_number(header.get("largest_error", 0.0), "largest_error")
    return made


def within(tensors: Mapping[str, Tensor], prefix: str) -> dict[str, Tensor]:
    """Return the tensors whose names begin with `prefix`, without it."""
    return {
        name.removeprefix(prefix): tensor
        for name, tensor in tensors.items()
        if name.startswith(prefix)
    }


TOLERANCE = 1e-9
"""Difference of matrices and translations up to which they are read as equal."""


def is_of_group(header: Any, group: CrystallographicGroup) -> bool:
    """Return whether `header`, from `group_header`, describes this group, its lattice *basis* included.

    Another basis of the same lattice numbers the frequencies otherwise: the same parameters would be
    another field.
    """
    try:
        tables = [(np.array(header[n], float), np.array(v)) for n, v in group_header(group).items()]
    except (KeyError, TypeError, ValueError, OverflowError):
        return False
    return all(a.shape == b.shape and np.allclose(a, b, rtol=0, atol=TOLERANCE) for a, b in tables)
