"""Files of named tensors with a JSON header and a checksum: safetensors, never pickle.

A checksum is the SHA-256 of the whole file with zeros in its own place: no bit can change unnoticed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError, system_errors
from orbiflow.runtime.files import is_object
from orbiflow.settings import as_path

if TYPE_CHECKING:
    from torch import Tensor

MAX_BYTES, MAX_HEADER = 256 * 2**20, 2**20
KEY = "orbiflow"
"""Under which the header stands among the file's metadata."""
CHECKSUM = "checksum"
"""Under which the checksum stands in the header, its first entry."""
_ZEROS = "0" * hashlib.sha256().digest_size * 2


def tensor_bytes(
    header: Mapping[str, Any], tensors: Mapping[str, Tensor], what: str = "tensors"
) -> bytes:
    """Return the content of a file that `read_tensors` reads again, as `array_bytes` does."""
    return array_bytes(
        header, {name: t.detach().cpu().numpy() for name, t in tensors.items()}, what
    )


def array_bytes(
    header: Mapping[str, Any], arrays: Mapping[str, Array], what: str, *, key: str = KEY
) -> bytes:
    """Return the content of a file that `read_arrays` reads again; `what` it holds is for messages.

    It has one entry of metadata, as several are in random order.
    """
    try:
        text = json.dumps({CHECKSUM: _ZEROS, **header}, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise OrbiflowError(f"what is saved beside {what} must be JSON: {error}") from error
    data = save({name: np.asarray(a, order="C") for name, a in arrays.items()}, {key: text})
    if int.from_bytes(data[:8], "little") > MAX_HEADER or len(data) > MAX_BYTES:
        raise OrbiflowError(
            f"the file would have {len(data) / 2**20:.1f} MB, {len(text) / 2**20:.1f} MB of them "
            f"header; at most {MAX_BYTES / 2**20:g} and {MAX_HEADER / 2**20:g} are read again"
        )
    return data.replace(_entry(_ZEROS), _entry(hashlib.sha256(data).hexdigest()), 1)


def _entry(digest: str) -> bytes:
    """Return the checksum as it stands in a file: JSON within a text of JSON."""
    return json.dumps(json.dumps({CHECKSUM: digest})[1:-1])[1:-1].encode()


def _check_sum(data: bytes, digest: object) -> str:
    """Return what is wrong with a file by its checksum, "" if nothing is."""
    if not isinstance(digest, str) or len(digest) != len(_ZEROS):
        return (
            "it has no checksum, so damage would not show; it was changed, or another "
            "program wrote it: save it again with orbiflow"
        )
    if hashlib.sha256(data.replace(_entry(digest), _entry(_ZEROS), 1)).hexdigest() != digest:
        return (
            "it was damaged or changed after it was saved: its checksum does not match; use a copy"
        )
    return ""


def read_tensors(path: str | Path, what: str) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the header and the tensors of a file that is to hold `what`, such as "a flow"."""
    import torch

    header, arrays = read_arrays(path, what)
    return header, {name: torch.tensor(array) for name, array in arrays.items()}


def read_arrays(
    path: str | Path, what: str, *, key: str = KEY, max_bytes: int = MAX_BYTES
) -> tuple[dict[str, Any], dict[str, Array]]:
    """Return the header of a file and its tensors as NumPy arrays; as `read_tensors`."""
    path = as_path(path, "the file")
    with system_errors(InputFileError, f"cannot read {path}"):
        size = path.stat().st_size
        if size > max_bytes:
            raise InputFileError(
                f"{path}: {size:,} bytes, too large for {what}: at most {max_bytes:,}"
            )
        data = path.read_bytes()
    try:
        header = _header(data, key)
        if wrong := _check_sum(data, header.pop(CHECKSUM, None)):
            raise InputFileError(f"{path}: {wrong}")
        return header, load(data)
    except InputFileError:
        raise
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
