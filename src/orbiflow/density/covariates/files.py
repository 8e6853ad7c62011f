"""Conditional densities on disk: safetensors, as densities are, never pickle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import torch

from orbiflow.density.covariates.density import ConditionalDensity
from orbiflow.density.models import known_kinds, space_from, space_header
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors, tensor_bytes

FORMAT = "orbiflow-conditional/1"
WHAT = "a density where covariates are known"


def conditional_to_bytes(density: ConditionalDensity, **extra: Any) -> bytes:
    """Return a conditional density as bytes that `read_conditional` makes the same again.

    `extra` are further values for the reader, for JSON.
    """
    space = space_header(density.space)
    document = {"format": FORMAT, **space, "density": density.header(), "extra": extra}
    return tensor_bytes(document, density.tensors(), WHAT)


def read_conditional(path: str | Path) -> tuple[ConditionalDensity, dict[str, Any]]:
    """Return a saved conditional density and what was saved with it.

    Raises `InputFileError` for a file that is missing, of something else, or damaged.
    """
    header, tensors = read_tensors(path, WHAT)
    try:
        if header["format"] != FORMAT:
            raise ValueError(f"format {header['format']!r}")
        known_kinds()
        with torch.inference_mode(False):
            made = ConditionalDensity.from_header(space_from(header), header["density"], tensors)
        return made, dict(header["extra"])
    except (
        OrbiflowError, ValueError, KeyError, TypeError, IndexError, AttributeError, RecursionError,
        RuntimeError,
    ) as error:  # fmt: skip
        raise InputFileError(
            f"{path}: not {WHAT} saved by orbiflow, or damaged ({error})"
        ) from error
