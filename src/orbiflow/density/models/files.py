"""Densities on disk: safetensors, never pickle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from orbiflow.density.models.conditional import ConditionalDensity
from orbiflow.density.models.density import Density
from orbiflow.density.models.headers import (
    density_from,
    density_parts,
    known_kinds,
    space_from,
    space_header,
    within,
)
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes
from orbiflow.settings import as_instance

FORMAT, A_DENSITY = "orbiflow-density/6", "a density"

GIVEN = "given."
"""What the names of tensors begin with that are of the density where covariates are known."""


def density_to_bytes(density: Density, **extra: Any) -> bytes:
    """Return a density as bytes that `read_density` makes the same again, with what is `given`.

    Saved are densities whose class has a `kind`, on spaces that `make_space` makes again, and flows of
    fields that orbiflow has; anything else is refused by the name of the part. `extra` are further
    values for the reader, for JSON.
    """
    header, tensors = density_parts(as_instance(density, Density, "density"), "density")
    document = {"format": FORMAT, **space_header(density.space), "density": header, "extra": extra}
    if density.given is not None:
        document["given"] = density.given.header()
        tensors |= {GIVEN + name: tensor for name, tensor in density.given.tensors().items()}
    return tensor_bytes(document, tensors, A_DENSITY)


def read_density(path: str | Path) -> tuple[Density, dict[str, Any]]:
    """Return a saved density and what was saved with it.

    Raises `InputFileError` for a file that is missing, no density, or damaged: no bit may have changed.
    """
    header, tensors = read_tensors(path, A_DENSITY)
    try:
        if header["format"] != FORMAT:
            raise ValueError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            known_kinds()
            space = space_from(header)
            density = density_from(space, header["density"], tensors)
            if "given" in header:
                parts = within(tensors, GIVEN)
                density.given = ConditionalDensity.from_header(space, header["given"], parts)
            return density, dict(header["extra"])
    except (
        OrbiflowError, ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError,
        RuntimeError,
    ) as error:  # fmt: skip
        raise InputFileError(
            f"{path}: not {A_DENSITY} saved by orbiflow, or damaged ({error})"
        ) from error
