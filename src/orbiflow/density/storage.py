"""A fitted density as bytes: safetensors, never pickle."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load, save

from orbiflow.density.bases import Base, UniformBase, VonMisesBase
from orbiflow.density.density import SymmetricDensity
from orbiflow.density.estimator import make_space
from orbiflow.density.kernels import AdaptiveKernels
from orbiflow.density.mixed import MixedDensity
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.fields import FourierField, SplineField
from orbiflow.flows import Flow

FORMAT = "orbiflow-density/1"
MAX_BYTES = 256 * 2**20
MAX_SEGMENTS, MAX_FREQUENCY, MAX_STEPS, MAX_KERNELS = 256, 128, 4096, 1_000_000
FIELDS: dict[str, type[FourierField | SplineField]] = {
    "fourier": FourierField,
    "spline": SplineField,
}


def density_to_bytes(density: SymmetricDensity, **extra: Any) -> bytes:
    """A density whose flow is made of Fourier or spline fields, with `extra` JSON for the reader.

    Raises:
        OrbiflowError: for other fields.
    """
    fields = list(density.flow.segments)
    names = [name for name, kind in FIELDS.items() if all(type(f) is kind for f in fields)]
    if not names or any(f.parameters_.dim() != 1 for f in fields):  # type: ignore[union-attr]
        raise OrbiflowError("only flows of single Fourier fields or spline fields are saved")
    first = fields[0]
    assert isinstance(first, FourierField | SplineField)
    base: dict[str, Any] = {"kind": "uniform"}
    if isinstance(density.base, VonMisesBase):
        base = {"kind": "von-mises", "concentration": density.base.concentration}
    header = {
        "format": FORMAT,
        "space": {"name": density.space.name, **density.space.settings()},
        "base": base,
        "flow": {
            "field": names[0],
            "max_frequency": first.max_frequency,
            "smoothness": first.smoothness,
            "steps": density.flow.steps,
            "method": density.flow.method,
            "duration": density.flow.duration,
        },
        "extra": extra,
    }
    stack = torch.stack([f.parameters_.detach().double().cpu() for f in fields])  # type: ignore[union-attr]
    tensors = {"parameters": stack}
    if isinstance(density, MixedDensity):
        kernels = density.kernels
        tensors |= {
            "kernel_centers": kernels.centers,
            "kernel_concentrations": kernels.concentrations,
            "kernel_weights": kernels.weights,
            "shares": density.shares,
        }
    tensors = {name: tensor.contiguous() for name, tensor in tensors.items()}
    return save(tensors, metadata={"orbiflow": json.dumps(header, allow_nan=False)})


def read_density(path: str | Path) -> tuple[SymmetricDensity, dict[str, Any]]:
    """A saved density, float64, and what was saved with it.

    Raises:
        InputFileError: if the file is missing, too large, damaged or of another kind.
    """
    path = Path(path)
    try:
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise InputFileError(f"{path}: {size / 2**20:.0f} MB, a density has at most 256 MB")
        data = path.read_bytes()
    except OSError as error:
        raise InputFileError(f"cannot read {path}: {error.strerror or error}") from error
    try:
        length = int.from_bytes(data[:8], "little")
        if not 2 <= length <= min(len(data) - 8, 2**20):
            raise ValueError("no header")
        header = json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["orbiflow"])
        if header["format"] != FORMAT:
            raise ValueError(f"format {header['format']!r}")
        return _restored(header, load(data)), header["extra"]
    except (
        SafetensorError,
        OrbiflowError,
        ValueError,
        KeyError,
        TypeError,
        RecursionError,
    ) as error:
        raise InputFileError(
            f"{path}: not a density saved by orbiflow, or damaged ({error})"
        ) from error


def _restored(header: dict[str, Any], tensors: dict[str, torch.Tensor]) -> SymmetricDensity:
    stack = tensors["parameters"]
    options = dict(header["space"])
    space = make_space(str(options.pop("name")), **options)
    flow = header["flow"]
    frequency = _bounded(flow["max_frequency"], MAX_FREQUENCY, "max_frequency")
    if space.dim > 3:
        raise ValueError("a Fourier flow has at most three dimensions")
    if stack.dim() != 2 or not 1 <= len(stack) <= MAX_SEGMENTS:
        raise ValueError(f"parameters of shape {tuple(stack.shape)}")
    if not bool(torch.isfinite(stack).all()):
        raise ValueError("parameters that are not finite")
    fields = []
    kind = FIELDS[flow.get("field", "fourier")]
    for row in stack:
        field = kind(space.group, frequency, smoothness=float(flow["smoothness"]))
        if field.parameters_.shape != row.shape:
            raise ValueError(f"{len(row)} parameters where {field.size} belong")
        with torch.no_grad():
            field.parameters_.copy_(row)
        fields.append(field)
    restored = Flow(
        fields,
        steps=_bounded(flow["steps"], MAX_STEPS, "steps"),
        method=str(flow["method"]),
        duration=float(flow["duration"]),
    )
    base: Base = UniformBase(space)
    if header["base"]["kind"] == "von-mises":
        base = VonMisesBase(space, float(header["base"]["concentration"]))
    if "shares" not in tensors:
        return SymmetricDensity(space, restored, base)
    parts = [tensors[f"kernel_{name}"] for name in ("centers", "concentrations", "weights")]
    if len(parts[0]) > MAX_KERNELS:
        raise ValueError(f"{len(parts[0])} kernels")
    return MixedDensity(space, restored, base, AdaptiveKernels(space, *parts), tensors["shares"])


def _bounded(value: Any, most: int, name: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise ValueError(f"{name} {value!r}")
    return value
