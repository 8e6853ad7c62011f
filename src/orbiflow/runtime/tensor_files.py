"""Files of named tensors with a JSON header beside them: safetensors, never pickle."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from safetensors import SafetensorError

from orbiflow.arguments import as_path
from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError, system_errors
from orbiflow.runtime.files import is_object

if TYPE_CHECKING:
    from torch import Tensor

Values = TypeVar("Values")

MAX_BYTES, MAX_HEADER = 256 * 2**20, 2**20
KEY = "orbiflow"
"""Under which the header stands among the file's metadata."""


def tensor_bytes(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], what: str = "tensors"
) -> bytes:
    """The content of a file that `read_tensors` reads again; `what` it holds is for messages."""
    from safetensors.torch import save

    try:
        text = json.dumps(header, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OrbiflowError(f"what is saved beside {what} must be JSON: {error}") from error
    alone = {name: t.detach().cpu().contiguous().clone() for name, t in tensors.items()}
    data = save(alone, metadata={KEY: text})
    if int.from_bytes(data[:8], "little") > MAX_HEADER or len(data) > MAX_BYTES:
        raise OrbiflowError(
            f"the file would have {len(data) / 2**20:.1f} MB, {len(text) / 2**20:.1f} MB of them "
            f"header; at most {MAX_BYTES / 2**20:g} and {MAX_HEADER / 2**20:g} are read again"
        )
    return data


def read_tensors(path: str | Path, what: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the header and the tensors of a file that is to hold `what`, such as "a flow"."""
    from safetensors.torch import load

    return _read(path, what, KEY, MAX_BYTES, load)


def read_arrays(
    path: str | Path, what: str, *, key: str = KEY, max_bytes: int = MAX_BYTES
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the header of a file and its tensors as NumPy arrays; as `read_tensors`."""
    from safetensors.numpy import load

    return _read(path, what, key, max_bytes, load)


def _read(
    path: str | Path,
    what: str,
    key: str,
    max_bytes: int,
    load: Callable[[bytes], dict[str, Values]],
) -> tuple[dict[str, Any], dict[str, Values]]:
    path = as_path(path, "the file")
    with system_errors(InputFileError, f"cannot read {path}"):
        size = path.stat().st_size
        if size > max_bytes:
            raise InputFileError(
                f"{path}: {size:,} bytes, too large for {what}: at most {max_bytes:,}"
            )
        data = path.read_bytes()
    try:
        return _header(data, key), load(data)
    except (SafetensorError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputFileError(
            f"{path}: not {what} saved by orbiflow, or damaged ({error})"
        ) from error


def _header(data: bytes, key: str) -> dict[str, Any]:
    length = int.from_bytes(data[:8], "little")
    if not 2 <= length <= min(len(data) - 8, MAX_HEADER):
        raise ValueError("no header")
    whole: Any = json.loads(data[8 : 8 + length])
    metadata: Any = whole.get("__metadata__") if is_object(whole) else None
    if not is_object(metadata) or key not in metadata:
        raise ValueError(f"no {key!r} in its header")
    header: Any = json.loads(metadata[key])
    if not is_object(header):
        raise ValueError("its header is no table")
    return header
