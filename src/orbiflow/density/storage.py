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
from orbiflow.density.mixture import MixtureBase
from orbiflow.density.neural import NeuralFlow
from orbiflow.density.neural_storage import (
    mixture_from_header,
    mixture_header,
    mixture_tensors,
    neural_from_header,
    neural_header,
    neural_tensors,
)
from orbiflow.density.space import Space
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.fields import FourierField, InvariantField, SplineField
from orbiflow.flows import Flow

FORMAT = "orbiflow-density/1"
MAX_BYTES = 256 * 2**20
MAX_SEGMENTS, MAX_FREQUENCY, MAX_STEPS, MAX_KERNELS = 256, 128, 4096, 1_000_000
FIELDS: dict[str, type[FourierField | SplineField]] = {
    "fourier": FourierField,
    "spline": SplineField,
}


def density_to_bytes(density: SymmetricDensity, **extra: Any) -> bytes:
    """A density whose flow has Fourier, spline or neural fields, with `extra` JSON for the reader.

    Raises:
        OrbiflowError: for other fields.
    """
    flow, tensors = _flow_parts(density.flow)
    base: dict[str, Any] = {"kind": "uniform"}
    if isinstance(density.base, VonMisesBase):
        base = {"kind": "von-mises", "concentration": density.base.concentration}
    elif isinstance(density.base, MixtureBase):
        base = mixture_header(density.base)
        tensors |= mixture_tensors(density.base)
    header = {
        "format": FORMAT,
        "space": {"name": density.space.name, **density.space.settings()},
        "base": base,
        "flow": flow,
        "extra": extra,
    }
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


def _flow_parts(flow: Flow) -> tuple[dict[str, Any], dict[str, torch.Tensor]]:
    """Header and tensors of a flow."""
    if isinstance(flow, NeuralFlow):
        return neural_header(flow), neural_tensors(flow)
    fields = list(flow.segments)
    names = [name for name, kind in FIELDS.items() if all(type(f) is kind for f in fields)]
    if not names or any(f.parameters_.dim() != 1 for f in fields):  # type: ignore[union-attr]
        raise OrbiflowError("only flows of Fourier, spline or neural fields are saved")
    first = fields[0]
    assert isinstance(first, InvariantField)
    header = {
        "kind": names[0],
        "max_frequency": first.max_frequency,
        "smoothness": first.smoothness,
        "steps": flow.steps,
        "method": flow.method,
        "duration": flow.duration,
    }
    rows = [f.parameters_.detach().double().cpu() for f in fields]  # type: ignore[union-attr]
    return header, {"parameters": torch.stack(rows)}


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
    options = dict(header["space"])
    space = make_space(str(options.pop("name")), **options)
    neural = header["flow"]["kind"] == "neural"
    flow = (
        neural_from_header(header["flow"], tensors, space)
        if neural
        else _tabled_flow(header["flow"], tensors["parameters"], space)
    )
    base: Base = UniformBase(space)
    if header["base"]["kind"] == "von-mises":
        base = VonMisesBase(space, float(header["base"]["concentration"]))
    elif header["base"]["kind"] == "mixture":
        base = mixture_from_header(header["base"], tensors, space)
    if "shares" not in tensors:
        return SymmetricDensity(space, flow, base)
    parts = [tensors[f"kernel_{name}"] for name in ("centers", "concentrations", "weights")]
    if len(parts[0]) > MAX_KERNELS:
        raise ValueError(f"{len(parts[0])} kernels")
    return MixedDensity(space, flow, base, AdaptiveKernels(space, *parts), tensors["shares"])


def _tabled_flow(header: dict[str, Any], stack: torch.Tensor, space: Space) -> Flow:
    """A flow of Fourier or spline fields."""
    frequency = _bounded(header["max_frequency"], MAX_FREQUENCY, "max_frequency")
    if space.dim > 3:
        raise ValueError("a flow of Fourier or spline fields has at most three dimensions")
    if stack.dim() != 2 or not 1 <= len(stack) <= MAX_SEGMENTS:
        raise ValueError(f"parameters of shape {tuple(stack.shape)}")
    if not bool(torch.isfinite(stack).all()):
        raise ValueError("parameters that are not finite")
    fields = []
    for row in stack:
        field = FIELDS[header["kind"]](
            space.group, frequency, smoothness=float(header["smoothness"])
        )
        if field.parameters_.shape != row.shape:
            raise ValueError(f"{len(row)} parameters where {field.size} belong")
        with torch.no_grad():
            field.parameters_.copy_(row)
        fields.append(field)
    return Flow(
        fields,
        steps=_bounded(header["steps"], MAX_STEPS, "steps"),
        method=str(header["method"]),
        duration=float(header["duration"]),
        warn=False,  # the fit has settled them and said if it could not
    )


def _bounded(value: Any, most: int, name: str) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise ValueError(f"{name} {value!r}")
    return value
