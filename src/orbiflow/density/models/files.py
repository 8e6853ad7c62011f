"""Densities on disk: safetensors, never pickle. JSON headers and tensors make them again."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.density import KINDS, Density
from orbiflow.density.spaces import Space, make_space
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes
from orbiflow.settings import as_instance, as_number
from orbiflow.symmetry import CrystallographicGroup, group_header

FORMAT = "orbiflow-density/6"


def density_to_bytes(density: Density, **extra: Any) -> bytes:
    """Return a density as bytes that `read_density` makes the same again.

    Saved are densities whose class has a `kind`, on spaces that `make_space` makes again, and flows of
    fields that orbiflow has; anything else is refused by the name of the part. `extra` are further
    values for the reader, for JSON.
    """
    header, tensors = density_parts(as_instance(density, Density, "density"), "density")
    space = space_header(density.space)
    document = {"format": FORMAT, **space, "density": header, "extra": extra}
    return tensor_bytes(document, tensors, "a density")


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


def read_density(path: str | Path) -> tuple[Density, dict[str, Any]]:
    """Return a saved density and what was saved with it.

    Raises `InputFileError` for a file that is missing, no density, or damaged: no bit may have changed.
    """
    header, tensors = read_tensors(path, "a density")
    try:
        if header["format"] != FORMAT:
            raise ValueError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            known_kinds()
            space = space_from(header)
            return density_from(space, header["density"], tensors), header["extra"]
    except (OrbiflowError, ValueError, KeyError, TypeError, RecursionError, RuntimeError) as error:
        raise InputFileError(
            f"{path}: not a density saved by orbiflow, or damaged ({error})"
        ) from error


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
    own = density.space
    if space is not None and space != own:
        raise OrbiflowError(
            f"the {name} is on {own!r}, the density on {space!r}: make both on one space"
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
