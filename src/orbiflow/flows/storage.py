"""Flows on disk: safetensors, never pickle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from orbiflow.arguments import instance, whole
from orbiflow.arguments import path as as_path
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.files import write_atomic
from orbiflow.flows.field_headers import Makers, Reader, Writer, finite
from orbiflow.flows.flow import Flow
from orbiflow.json_values import is_list
from orbiflow.tensor_files import read_tensors, tensor_bytes

FORMAT = "orbiflow-flow/1"
MAX_SEGMENTS, MAX_STEPS = 256, 2**20


def save_flow(flow: Flow, path: str | Path) -> Path:
    """Write a flow to a file that `load_flow` reads, parameters bit for bit; returns the path.

    Its fields may be of any kind of `orbiflow.fields`, symmetrized ones included. Of a field of your
    own, a module or a function, the file holds the parameters and the name: `load_flow` asks for it.

    Raises:
        OrbiflowError: naming the part that cannot be saved.
        OutputError: if the file cannot be written.
    """
    path = as_path(path, "the flow's file")
    instance(flow, Flow, "the flow")
    if type(flow) is not Flow:
        raise OrbiflowError(
            f"the flow is a {type(flow).__name__}; where that adds nothing to the map, save "
            "Flow(flow.fields(), steps=flow.steps, method=flow.method)"
        )
    fields = flow.fields()
    if len(fields) > MAX_SEGMENTS or flow.steps > MAX_STEPS:
        raise OrbiflowError(
            f"the flow has {len(fields)} segments of {flow.steps} steps; saved are at most "
            f"{MAX_SEGMENTS} of {MAX_STEPS}"
        )
    tensors = flow.state_dict()
    _check_finite(tensors)
    writer = Writer()
    segments: list[dict[str, Any]] = []
    for number, field in enumerate(fields):
        first = next(i for i, other in enumerate(fields) if other is field)
        place = f"segments.{number}"
        segments.append(
            {"kind": "same", "segment": first} if first < number else writer.header(field, place)
        )
    header = {
        "format": FORMAT,
        "groups": writer.groups,
        "segments": segments,
        "steps": flow.steps,
        "method": flow.method,
        "duration": flow.duration,
        "warn": flow.warns,
    }
    return write_atomic(path, tensor_bytes(header, tensors, "a flow"))


def load_flow(path: str | Path, *, modules: Makers | None = None) -> Flow:
    """The flow that `save_flow` wrote, on the CPU.

    Args:
        path: of the file.
        modules: for each field of your own, by the name of its class or function, or by its place such
            as "segments.0.field": a callable without arguments that gives one, whose parameters are
            then filled in. Nothing in a file is ever run.

    Raises:
        InputFileError: if the file is missing, too large, damaged or of another kind, or asks for a
            field that is not among `modules`.

    >>> import tempfile
    >>> from orbiflow.fields import FourierField
    >>> from orbiflow.symmetry import wallpaper_group
    >>> flow = Flow(FourierField(wallpaper_group("p4"), 3), steps=8)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load_flow(save_flow(flow, f"{folder}/p4.safetensors")).steps
    8
    """
    header, tensors = read_tensors(path, "a flow")
    try:
        if header["format"] != FORMAT:
            raise OrbiflowError(f"format {header['format']!r}")
        with torch.inference_mode(False):  # what is made in it could never be differentiated
            return _restored(header, tensors, modules or {})
    except (OrbiflowError, ValueError, KeyError, TypeError, RecursionError, RuntimeError) as error:
        raise InputFileError(f"{path}: no flow can be made of it: {error}") from error


def _restored(header: Mapping[str, Any], tensors: dict[str, Tensor], makers: Makers) -> Flow:
    _check_finite(tensors)
    segments = header["segments"]
    if not is_list(segments) or not 1 <= len(segments) <= MAX_SEGMENTS:
        raise OrbiflowError("no segments, or too many")
    shapes = {name: tuple(tensor.shape) for name, tensor in tensors.items()}
    reader = Reader(header["groups"], shapes, makers)
    fields: list[Any] = []
    for number, part in enumerate(segments):
        if part["kind"] == "same":
            fields.append(fields[whole(part["segment"], "segment", 0, number - 1)])
        else:
            fields.append(reader.field(part, f"segments.{number}"))
    flow = Flow(
        fields,
        steps=whole(header["steps"], "steps", 1, MAX_STEPS),
        method=str(header["method"]),
        duration=finite(header["duration"], "duration"),
        warn=bool(header["warn"]),
    )
    _fill(flow, tensors)
    return flow


def _fill(flow: Flow, tensors: Mapping[str, Tensor]) -> None:
    expected = flow.state_dict()
    for name in (*expected, *tensors):
        if name not in tensors or name not in expected:
            where = "its fields" if name in expected else "the file"
            raise OrbiflowError(f"{name} is in {where} alone")
        if expected[name].shape != tensors[name].shape:
            raise OrbiflowError(
                f"{name} has shape {tuple(tensors[name].shape)}, expected "
                f"{tuple(expected[name].shape)}"
            )
    flow.load_state_dict(dict(tensors))


def _check_finite(tensors: Mapping[str, Tensor]) -> None:
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            raise OrbiflowError(f"{name} has values that are not finite numbers")
