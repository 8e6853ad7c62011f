"""Vector fields as JSON: what, with their parameters, makes them again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, cast

import torch
from torch import nn

from orbiflow.arguments import number, whole
from orbiflow.errors import OrbiflowError
from orbiflow.fields import (
    FourierField,
    InvariantField,
    NeuralTorusField,
    PeriodicFeatures,
    SplineField,
    Symmetrized,
)
from orbiflow.fields.torus_network import MAX_DEPTH, MAX_DIM, MAX_WAVES, MAX_WIDTH
from orbiflow.json_values import is_list
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.header import group_from_header, group_header

Makers = Mapping[str, Callable[[], Any]]
"""What makes a user's own fields, without their parameters, by the field's name or place."""

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
    """Takes fields apart; `groups` are those that they share, by the numbers they are written in."""

    def __init__(self) -> None:
        self.groups: list[dict[str, Any]] = []

    def header(self, field: Any, place: str) -> dict[str, Any]:
        """The field at `place` in the flow, ready for JSON.

        Raises:
            OrbiflowError: for a function without a name to ask for it by.
        """
        kind = type(cast(object, field))
        if kind in _SERIES_NAMES:
            return self._series(field)
        if kind is Symmetrized:
            inner = self.header(field.field, f"{place}.field")
            return {
                "kind": "symmetrized",
                "group": self._group(field.group),
                "periodic": field.periodic,
                "field": inner,
            }
        if kind is NeuralTorusField:
            sizes = {name: getattr(field, name) for name in ("dim", "width", "depth", "waves")}
            return {"kind": "torus-network", **sizes, "dtype": _dtype(field.last.weight)}
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
        return {"kind": "own", "name": _own_name(field, place)}

    def _series(self, field: FourierField | SplineField) -> dict[str, Any]:
        own = field.parameters_
        return {
            "kind": _SERIES_NAMES[type(field)],
            "group": self._group(field.group),
            "max_frequency": field.max_frequency,
            "smoothness": float(field.smoothness),
            "batch": len(own) if own.dim() == 2 else None,
            "parameters": own.shape[-1],
            "dtype": _dtype(own),
        }

    def _group(self, group: CrystallographicGroup) -> int:
        header = {**group_header(group), "name": group.name}
        if header not in self.groups:
            self.groups.append(header)
        return self.groups.index(header)


class Reader:
    """Makes fields again, without their parameters; sizes are checked before anything is made."""

    def __init__(self, groups: Any, shapes: Mapping[str, tuple[int, ...]], makers: Makers) -> None:
        if not is_list(groups) or len(groups) > MAX_GROUPS:
            raise OrbiflowError(f"expected at most {MAX_GROUPS} groups")
        self.groups = [group_from_header(header, header["name"]) for header in groups]
        self.shapes, self.makers = shapes, makers

    def field(self, header: Mapping[str, Any], place: str, nesting: int = 0) -> Any:
        """The field whose tensors' names begin with `place`.

        Raises:
            OrbiflowError, KeyError, TypeError, ValueError: for what does not fit.
        """
        if nesting > MAX_NESTING:
            raise OrbiflowError(f"fields within more than {MAX_NESTING} others")
        kind = header["kind"]
        if kind in SERIES:
            return self._series(header, place)
        if kind == "symmetrized":
            inner = self.field(header["field"], f"{place}.field", nesting + 1)
            return Symmetrized(inner, self._group(header), periodic=bool(header["periodic"]))
        if kind == "torus-network":
            return self._torus_network(header, place)
        if kind == "perceptron":
            return self._perceptron(header, place)
        if kind == "own":
            return self._own(str(header["name"]), place)
        raise OrbiflowError(f"a field of kind {kind!r}")

    def _group(self, header: Mapping[str, Any]) -> CrystallographicGroup:
        return self.groups[whole(header["group"], "group", 0, len(self.groups) - 1)]

    def _series(self, header: Mapping[str, Any], place: str) -> InvariantField:
        group = self._group(header)
        frequency = whole(header["max_frequency"], "max_frequency", 0, MAX_FREQUENCY)
        count = whole(header["parameters"], "parameters", 0)
        batch = None if header["batch"] is None else whole(header["batch"], "batch", 0)
        expected = (count,) if batch is None else (batch, count)
        self._check(f"{place}.parameters_", expected)
        # nearly one coefficient in |G| is free: no header makes more work than its file has numbers
        if (2 * frequency + 1) ** group.dim * group.dim > 4 * group.order * (count + 100):
            raise OrbiflowError(f"max_frequency {frequency} with {count} parameters")
        options: dict[str, Any] = {
            "smoothness": number(header["smoothness"], "smoothness", -1e6, 1e6),
            "dtype": DTYPES[header["dtype"]],
        }
        if batch is not None:
            options["batch"] = batch
        return SERIES[header["kind"]](group, frequency, **options)

    def _perceptron(self, header: Mapping[str, Any], place: str) -> nn.Sequential:
        group = self._group(header)
        frequency = whole(header["max_frequency"], "max_frequency", 1, MAX_FREQUENCY)
        sizes = [whole(size, "sizes", 1, 2**20) for size in header["sizes"]]
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

    def _torus_network(self, header: Mapping[str, Any], place: str) -> NeuralTorusField:
        most = {"dim": MAX_DIM, "width": MAX_WIDTH, "depth": MAX_DEPTH, "waves": MAX_WAVES}
        sizes: dict[str, Any] = {
            name: whole(header[name], name, 1, bound) for name, bound in most.items()
        }
        with torch.device("meta"):  # where shapes cost nothing
            expected = NeuralTorusField(**sizes).state_dict()
        for name, tensor in expected.items():
            self._check(f"{place}.{name}", tuple(tensor.shape))
        return NeuralTorusField(**sizes, dtype=DTYPES[header["dtype"]])

    def _own(self, name: str, place: str) -> Any:
        make = self.makers.get(place) or self.makers.get(name)
        if make is None:
            raise OrbiflowError(
                f"{place} is a field of your own, {name}, of which a file holds the parameters "
                f"alone: load_flow(path, modules={{{name!r}: make}}), make() giving one"
            )
        made = make()
        if not callable(made):
            raise OrbiflowError(f"modules[{name!r}] made no field but {made!r}")
        return made

    def _check(self, name: str, expected: tuple[int, ...]) -> None:
        if self.shapes.get(name) != expected:
            raise OrbiflowError(f"{name} has shape {self.shapes.get(name)}, expected {expected}")


def is_perceptron(field: Any) -> bool:
    """Whether it is built as that of `neural_field` is."""
    if type(field) is not nn.Sequential or len(field) < 2 or len(field) % 2:
        return False
    wanted = [PeriodicFeatures, *[nn.Linear, nn.Tanh] * (len(field) // 2)][: len(field)]
    layers: list[Any] = [layer for layer in field if isinstance(layer, nn.Linear)]
    return all(type(m) is kind for m, kind in zip(field, wanted, strict=True)) and all(
        layer.bias is not None for layer in layers
    )


def _own_name(field: Any, place: str) -> str:
    name = type(field).__name__ if isinstance(field, nn.Module) else getattr(field, "__name__", "")
    if not name.isidentifier():
        raise OrbiflowError(
            f"{place} is a function without a name, {field!r}, which no file holds: define it with "
            "def, or as a torch module, and give it to load_flow(path, modules=...) by its name"
        )
    return name


def _dtype(tensor: torch.Tensor) -> str:
    name = str(tensor.dtype).removeprefix("torch.")
    if name not in DTYPES:
        raise OrbiflowError(f"parameters of {tensor.dtype} are not saved: {', '.join(DTYPES)} are")
    return name


def finite(value: Any, name: str) -> float:
    """`value` as a finite number."""
    return number(value, name, -math.inf)
