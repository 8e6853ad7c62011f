"""Densities on disk: safetensors, never pickle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor

from orbiflow.density.models.conditional import ConditionalDensity
from orbiflow.density.models.density import Density
from orbiflow.density.models.headers import (
    density_from,
    density_parts,
    known_kinds,
    space_from,
    space_header,
)
from orbiflow.density.spaces import Space
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes
from orbiflow.settings import as_instance

FORMAT, CONDITIONAL_FORMAT = "orbiflow-density/6", "orbiflow-conditional/1"
A_DENSITY, A_CONDITIONAL = "a density", "a density where covariates are known"

Made = TypeVar("Made")


def density_to_bytes(density: Density | ConditionalDensity, **extra: Any) -> bytes:
    """Return a density as bytes that `read_density` or `read_conditional` makes the same again.

    Saved are densities whose class has a `kind`, on spaces that `make_space` makes again, and flows of
    fields that orbiflow has; anything else is refused by the name of the part. `extra` are further
    values for the reader, for JSON.
    """
    if isinstance(density, ConditionalDensity):
        name, what, parts = CONDITIONAL_FORMAT, A_CONDITIONAL, (density.header(), density.tensors())
    else:
        name, what = FORMAT, A_DENSITY
        parts = density_parts(as_instance(density, Density, "density"), "density")
    space = space_header(density.space)
    return tensor_bytes(
        {"format": name, **space, "density": parts[0], "extra": extra}, parts[1], what
    )


def read_density(path: str | Path) -> tuple[Density, dict[str, Any]]:
    """Return a saved density and what was saved with it.

    Raises `InputFileError` for a file that is missing, no density, or damaged: no bit may have changed.
    """
    return _read(path, FORMAT, A_DENSITY, density_from)


def read_conditional(path: str | Path) -> tuple[ConditionalDensity, dict[str, Any]]:
    """Return a saved density where covariates are known; otherwise as `read_density`."""
    return _read(path, CONDITIONAL_FORMAT, A_CONDITIONAL, ConditionalDensity.from_header)


def _read(
    path: str | Path,
    name: str,
    what: str,
    make: Callable[[Space, Mapping[str, Any], Mapping[str, Tensor]], Made],
) -> tuple[Made, dict[str, Any]]:
    """Return what a file of a format holds, and what was saved with it."""
    header, tensors = read_tensors(path, what)
    try:
        if header["format"] != name:
            raise ValueError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            known_kinds()
            return make(space_from(header), header["density"], tensors), dict(header["extra"])
    except (
        OrbiflowError, ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError,
        RuntimeError,
    ) as error:  # fmt: skip
        raise InputFileError(
            f"{path}: not {what} saved by orbiflow, or damaged ({error})"
        ) from error
