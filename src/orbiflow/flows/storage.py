"""Flows on disk: safetensors, never pickle."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn

from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.fields import FourierField, InvariantField, PeriodicFeatures, SplineField, Symmetrized
from orbiflow.flows.flow import Flow
from orbiflow.runtime import is_list, read_tensors, tensor_bytes, write_atomic
from orbiflow.settings import as_instance, as_number, as_path, as_whole
from orbiflow.symmetry import CrystallographicGroup, group_from_header, group_header

# functions that create a user's own fields, by the name or the place of the field
FieldFactories = Mapping[str, Callable[[], Any]]

MAX_GROUPS, MAX_LAYERS, MAX_NESTING, MAX_FREQUENCY = 64, 64, 4, 10**6

SERIES: dict[str, type[FourierField | SplineField]] = {
    "fourier": FourierField,
    "spline": SplineField,
}
_SERIES_NAMES = {kind: name for name, kind in SERIES.items()}
DTYPES = {
    str(t).removeprefix("torch."): t
    for t in (torch.float64, torch.float32, torch.float16, torch.bfloat16)
}


class Writer:
    """A writer of fields as JSON; `groups` holds the headers of the groups that they share.

    It refuses fields of the user's own unless whoever reads them can be given functions that make them.
    """

    def __init__(self, *, with_own: bool) -> None:
        self.groups: list[dict[str, Any]] = []
        self._with_own = with_own

    def header(self, field: Any, place: str) -> dict[str, Any]:
        """Return the field at `place` in the flow, ready for JSON."""
        kind = type(cast(object, field))
        if kind in _SERIES_NAMES:
            return self._series(field)
        if kind is Symmetrized:
            inner = self.header(field.field, f"{place}.field")
            facts = {"group": self._group(field.group), "periodic": field.periodic, "field": inner}
            along = {} if field.along is None else {"along": field.along}
            return {"kind": "symmetrized", **facts, **along}
        if is_perceptron(field):
            features, *layers = field
            linear = [layer for layer in layers if isinstance(layer, nn.Linear)]
            return {
                "kind": "perceptron",
                "group": self._group(features.group),
                "max_frequency": features.max_frequency,
                "sizes": [layer.out_features for layer in linear],
                "dtype": _dtype(linear[0].weight),
            }
        if not self._with_own:
            raise OrbiflowError(
                f"{place} of the flow is a {kind.__name__}, a field of your own, which only "
                "orbiflow.flows.save_flow saves"
            )
        return {"kind": "own", "name": _own_name(field, place)}

    def _series(self, field: FourierField | SplineField) -> dict[str, Any]:
        parameters = field.parameters_
        return {
            "kind": _SERIES_NAMES[type(field)],
            "group": self._group(field.group),
            "max_frequency": field.max_frequency,
            "smoothness": float(field.smoothness),
            "divergence_free": field.divergence_free,
            "batch": len(parameters) if parameters.dim() == 2 else None,
            "parameters": parameters.shape[-1],
            "dtype": _dtype(parameters),
        }

    def _group(self, group: CrystallographicGroup) -> int:
        header = {**group_header(group), "name": group.name}
        if header not in self.groups:
            self.groups.append(header)
        return self.groups.index(header)


class Reader:
    """A reader that creates fields without their parameters, after it has checked all sizes."""

    def __init__(
        self, groups: Any, shapes: Mapping[str, tuple[int, ...]], makers: FieldFactories
    ) -> None:
        if not is_list(groups) or len(groups) > MAX_GROUPS:
            raise OrbiflowError(f"expected at most {MAX_GROUPS} groups")
        self.groups = [group_from_header(header, header["name"]) for header in groups]
        self.shapes, self.makers = shapes, makers

    def field(self, header: Mapping[str, Any], place: str, nesting: int = 0) -> Any:
        """Return the field whose tensors' names begin with `place`."""
        if nesting > MAX_NESTING:
            raise OrbiflowError(f"fields are nested more than {MAX_NESTING} deep")
        kind = header["kind"]
        if kind in SERIES:
            return self._series(header, place)
        if kind == "symmetrized":
            inner = self.field(header["field"], f"{place}.field", nesting + 1)
            group, periodic = self._group(header), bool(header["periodic"])
            return Symmetrized(inner, group, periodic=periodic, along=header.get("along"))
        if kind == "perceptron":
            return self._perceptron(header, place)
        if kind == "own":
            return self._own(str(header["name"]), place)
        raise OrbiflowError(f"a field of kind {kind!r}")

    def _group(self, header: Mapping[str, Any]) -> CrystallographicGroup:
        return self.groups[as_whole(header["group"], "group", 0, len(self.groups) - 1)]

    def _series(self, header: Mapping[str, Any], place: str) -> InvariantField:
        group = self._group(header)
        frequency = as_whole(header["max_frequency"], "max_frequency", 0, MAX_FREQUENCY)
        count = as_whole(header["parameters"], "parameters", 0)
        batch = None if header["batch"] is None else as_whole(header["batch"], "batch", 0)
        expected = (count,) if batch is None else (batch, count)
        self._check(f"{place}.parameters_", expected)
        # about one coefficient in |G| is free, so the file's size bounds the work of its header
        if (2 * frequency + 1) ** group.dim * group.dim > 4 * group.order * (count + 100):
            raise OrbiflowError(f"max_frequency {frequency} with {count} parameters")
        options: dict[str, Any] = {
            "smoothness": as_number(header["smoothness"], "smoothness", -1e6, 1e6),
            "dtype": DTYPES[header["dtype"]],
        }
        if header["divergence_free"] is True:
            options["divergence_free"] = True
        if batch is not None:
            options["batch"] = batch
        return SERIES[header["kind"]](group, frequency, **options)

    def _perceptron(self, header: Mapping[str, Any], place: str) -> nn.Sequential:
        group = self._group(header)
        frequency = as_whole(header["max_frequency"], "max_frequency", 1, MAX_FREQUENCY)
        sizes = [as_whole(size, "sizes", 1, 2**20) for size in header["sizes"]]
        if not 1 <= len(sizes) <= MAX_LAYERS:
            raise OrbiflowError(f"a perceptron of {len(sizes)} layers")
        d = group.dim
        before = (2 * frequency + 1) ** d - 1 if d <= 3 else 2 * frequency * d
        for i, size in enumerate(sizes):
            self._check(f"{place}.{2 * i + 1}.weight", (size, before))
            before = size
        features = PeriodicFeatures(group, frequency)
        layers: list[nn.Module] = [features]
        for i, size in enumerate(sizes):
            wide = features.size if i == 0 else sizes[i - 1]
            layers += [nn.Linear(wide, size, dtype=DTYPES[header["dtype"]]), nn.Tanh()]
        return nn.Sequential(*layers[:-1])

    def _own(self, name: str, place: str) -> Any:
        make = self.makers.get(place) or self.makers.get(name)
        if make is None:
            raise OrbiflowError(
                f"{place} is a field of your own, {name}, and the file holds only its parameters: "
                f"call load_flow(path, modules={{{name!r}: make}}), where make() creates the field"
            )
        made = make()
        if not callable(made):
            raise OrbiflowError(f"modules[{name!r}] must create a field, it created {made!r}")
        return made

    def _check(self, name: str, expected: tuple[int, ...]) -> None:
        if self.shapes.get(name) != expected:
            raise OrbiflowError(f"{name} has shape {self.shapes.get(name)}, expected {expected}")


def is_perceptron(field: Any) -> bool:
    """Return whether `field` is a network of linear layers and tanh on `PeriodicFeatures`."""
    if type(field) is not nn.Sequential or len(field) < 2 or len(field) % 2:
        return False
    wanted = [PeriodicFeatures, *[nn.Linear, nn.Tanh] * (len(field) // 2)][:-1]
    linear: list[Any] = [layer for layer in field if isinstance(layer, nn.Linear)]
    return list(map(type, field)) == wanted and all(layer.bias is not None for layer in linear)


def _own_name(field: Any, place: str) -> str:
    name = type(field).__name__ if isinstance(field, nn.Module) else getattr(field, "__name__", "")
    if not name.isidentifier():
        raise OrbiflowError(
            f"{place} is a function without a name, {field!r}, which cannot be saved: define it "
            "with def, or as a torch module, and pass it to load_flow(path, modules=...) by its name"
        )
    return name


def _dtype(tensor: torch.Tensor) -> str:
    name = str(tensor.dtype).removeprefix("torch.")
    if name not in DTYPES:
        raise OrbiflowError(
            f"parameters of {tensor.dtype} cannot be saved: convert them to {', '.join(DTYPES)}"
        )
    return name


FORMAT = "orbiflow-flow/1"
MAX_SEGMENTS, MAX_STEPS = 256, 2**20


def save_flow(flow: Flow, path: str | Path) -> Path:
    """Write a flow to a file that `load_flow` reads, with bit-identical parameters; return the path.

    Its fields may be of any kind in `orbiflow.fields`, also symmetrized. For a field of your own, a
    module or a function, the file holds the parameters and the name, by which `load_flow` takes it.

    Raises:
        OrbiflowError: if a part, which it names, cannot be saved.
        OutputError: if the file cannot be written.
    """
    path = as_path(path, "the flow's file")
    header, tensors = flow_parts(as_instance(flow, Flow, "the flow"))
    return write_atomic(path, tensor_bytes({"format": FORMAT, **header}, tensors, "a flow"))


def flow_parts(flow: Flow, *, with_own: bool = True) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return a header ready for JSON and the tensors, of which `flow_from` makes the flow again."""
    if type(flow) is not Flow:
        raise OrbiflowError(
            f"the flow is a {type(flow).__name__}; where that adds nothing to the map, save "
            "Flow(flow.fields(), steps=flow.steps, method=flow.method)"
        )
    fields = flow.fields()
    if len(fields) > MAX_SEGMENTS or flow.steps > MAX_STEPS:
        raise OrbiflowError(
            f"the flow has {len(fields)} segments of {flow.steps} steps; at most {MAX_SEGMENTS} "
            f"segments of {MAX_STEPS} steps can be saved"
        )
    tensors = flow.state_dict()
    _check_finite(tensors)
    writer = Writer(with_own=with_own)
    segments: list[dict[str, Any]] = []
    for index, field in enumerate(fields):
        first = next(i for i, other in enumerate(fields) if other is field)
        same = {"kind": "same", "segment": first}
        segments.append(same if first < index else writer.header(field, f"segments.{index}"))
    header = {"groups": writer.groups, "segments": segments, "warn": flow.warns}
    header |= {name: getattr(flow, name) for name in ("steps", "method", "duration")}
    if flow.bijective:
        header["bijective"] = True
    return header, tensors


def load_flow(path: str | Path, *, modules: FieldFactories | None = None) -> Flow:
    """Return the flow that `save_flow` wrote, on the CPU.

    Args:
        path: The path of the file.
        modules: A function without arguments that creates each field of your own, by the name of its
            class or function, or by its place such as "segments.0.field". Its parameters are filled
            in. Nothing in a file is ever run.

    Raises `InputFileError` if the file is missing, too large, damaged or of another kind, or asks
    for a field that is not among `modules`.

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
        with torch.inference_mode(False):  # otherwise it could never be differentiated
            return flow_from(header, tensors, modules or {})
    except (OrbiflowError, ValueError, KeyError, TypeError, RecursionError, RuntimeError) as error:
        raise InputFileError(f"{path}: cannot be read as a flow: {error}") from error


def flow_from(
    header: Mapping[str, Any], tensors: dict[str, Tensor], makers: FieldFactories
) -> Flow:
    """Return the flow of `flow_parts`; `makers` are as for `load_flow`."""
    _check_finite(tensors)
    segments = header["segments"]
    if not is_list(segments) or not 1 <= len(segments) <= MAX_SEGMENTS:
        raise OrbiflowError("no segments, or too many")
    shapes = {name: tuple(tensor.shape) for name, tensor in tensors.items()}
    reader = Reader(header["groups"], shapes, makers)
    fields: list[Any] = []
    for index, part in enumerate(segments):
        if part["kind"] == "same":
            fields.append(fields[as_whole(part["segment"], "segment", 0, index - 1)])
        else:
            fields.append(reader.field(part, f"segments.{index}"))
    flow = Flow(
        fields,
        steps=as_whole(header["steps"], "steps", 1, MAX_STEPS),
        method=str(header["method"]),
        duration=as_number(header["duration"], "duration"),
        warn=bool(header["warn"]),
        bijective=bool(header.get("bijective", False)),
    )
    flow.load_state_dict(tensors)
    return flow


def _check_finite(tensors: Mapping[str, Tensor]) -> None:
    for name, tensor in tensors.items():
        if not bool(torch.isfinite(tensor).all()):
            raise OrbiflowError(f"{name} has values that are not finite numbers")
