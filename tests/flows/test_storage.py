"""Flows saved and loaded: the same map, bit for bit, and nothing else from a hostile file."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from safetensors.torch import load, save
from torch import Tensor, nn

from orbiflow.errors import InputFileError, OutputError
from orbiflow.fields import FourierField, SplineField, symmetrize
from orbiflow.flows import METHODS, Flow, load_flow, save_flow
from orbiflow.symmetry import CrystallographicGroup, identification_group, wallpaper_group
from refusals import refused
from sealed import sealed
from strategies import groups, neural_field, random_tensor, seeds, space_group

one_folder = settings(
    max_examples=12, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)


class Swirl(nn.Module):
    """A user's own network."""

    def __init__(self, width: int = 5) -> None:
        super().__init__()
        self.inside = nn.Linear(2, width, dtype=torch.float64)
        self.outside = nn.Linear(width, 2, dtype=torch.float64)
        self.register_buffer("count", torch.tensor(3))

    def forward(self, points: Tensor) -> Tensor:
        return self.outside(torch.tanh(self.inside(points)))


def shear(points: Tensor) -> Tensor:
    """A user's own function."""
    return points.flip(-1) / 4


def turning(points: Tensor) -> Tensor:
    """Another one."""
    return torch.sin(points)


def filled(field: Any, seed: int) -> Any:
    """The field with random parameters."""
    with torch.no_grad():
        for i, parameter in enumerate(field.parameters()):
            parameter.copy_(0.1 * random_tensor(seed + i, *parameter.shape))
    return field


def some_field(kind: str, group: CrystallographicGroup, seed: int, dtype: torch.dtype) -> nn.Module:
    if kind == "network":
        return filled(
            neural_field(group, hidden=(4, 3), max_frequency=1 + seed % 2, dtype=dtype), seed
        )
    field = FourierField(group, seed % 3, smoothness=seed % 4 / 2, dtype=dtype)
    return symmetrize(filled(field, seed), group) if kind == "symmetrized" else filled(field, seed)


kinds = st.lists(st.sampled_from(["fourier", "network", "symmetrized"]), min_size=1, max_size=3)


@one_folder
@given(
    kinds,
    groups,
    seeds,
    st.integers(1, 5),
    st.sampled_from(sorted(METHODS)),
    st.floats(-2, 2),
    st.sampled_from([torch.float64, torch.float32]),
    st.booleans(),
)
def test_what_is_loaded_is_what_was_saved(
    tmp_path, kinds, group, seed, steps, method, duration, dtype, warn
):
    fields = [some_field(kind, group, seed + i, dtype) for i, kind in enumerate(kinds)]
    flow = Flow(fields, steps=steps, method=method, duration=duration, warn=warn)
    again = load_flow(save_flow(flow, tmp_path / "flow.safetensors"))
    settings_of = lambda f: (f.steps, f.method, f.duration, f.warns)  # noqa: E731
    assert settings_of(again) == settings_of(flow)
    points = random_tensor(seed, 6, group.dim, dtype=dtype)
    assert torch.equal(again.carried(points), flow.carried(points))
    start = flow.carried(points, inverse=True)
    assert torch.equal(again.carried(points, inverse=True), start)
    for name, value in flow.state_dict().items():
        assert torch.equal(again.state_dict()[name], value)
        assert again.state_dict()[name].dtype == value.dtype
    assert all(p.requires_grad for p in again.parameters())
    for one, other in zip(flow.fields(), again.fields(), strict=True):
        if hasattr(one, "group"):
            assert np.array_equal(one.group.lattice, other.group.lattice)
            assert np.array_equal(one.group.linear_parts, other.group.linear_parts)
            assert np.array_equal(one.group.translations, other.group.translations)
            assert one.group.name == other.group.name


def test_splines_stacks_and_large_groups(tmp_path: Path) -> None:
    spline = filled(SplineField(identification_group("sphere"), 3), 1)
    flow = load_flow(save_flow(Flow([spline, spline], steps=2), tmp_path / "a"))
    points = random_tensor(1, 5, 2)
    assert torch.equal(flow.carried(points), Flow([spline, spline], steps=2).carried(points))
    assert flow.fields()[0] is flow.fields()[1]  # as it was: trained together
    stack = filled(FourierField(wallpaper_group("p6"), 2, batch=3), 2)
    flow = load_flow(save_flow(Flow(stack, steps=2), tmp_path / "b"))
    points = random_tensor(2, 3, 5, 2)
    assert torch.equal(flow.carried(points), Flow(stack, steps=2).carried(points))
    large = filled(FourierField(space_group("Fm-3m", 1), 1), 3)
    flow = load_flow(save_flow(Flow(large, steps=1), tmp_path / "c"))
    points = random_tensor(3, 5, 3)
    assert torch.equal(flow.carried(points), Flow(large, steps=1).carried(points))


def own_flow() -> Flow:
    group = wallpaper_group("p3")
    fields = [symmetrize(Swirl(), group), shear, symmetrize(turning, group), Swirl(7)]
    return Flow(fields, steps=2)


def test_fields_of_ones_own_are_asked_for_by_name(tmp_path: Path) -> None:
    flow, points = own_flow(), random_tensor(4, 5, 2)
    path = save_flow(flow, tmp_path / "own.safetensors")
    makers: dict[str, Callable[[], Any]] = {
        "Swirl": Swirl,
        "segments.3": lambda: Swirl(7),
        "shear": lambda: shear,
        "turning": lambda: turning,
    }
    assert torch.equal(load_flow(path, modules=makers).carried(points), flow.carried(points))
    for name, said in {
        "Swirl": r"segments\.0\.field is a field of your own, Swirl, .*load_flow\(path, modules=",
        "shear": r"segments\.1 is a field of your own, shear",
        "turning": r"segments\.2\.field is a field of your own, turning",
        "segments.3": r"size mismatch for segments\.3\.inside\.weight",
    }.items():
        fewer = {key: make for key, make in makers.items() if key != name}
        with pytest.raises(InputFileError, match=said):
            load_flow(path, modules=fewer)
    with refused("own.safetensors", "shear", 3, kind=InputFileError):
        load_flow(path, modules={**makers, "shear": lambda: 3})


def test_what_cannot_be_saved_is_named(tmp_path: Path) -> None:
    path = tmp_path / "flow"
    with refused("segments.0"):
        save_flow(Flow(lambda p: p), path)
    broken = filled(FourierField(wallpaper_group("p4"), 2), 1)
    with torch.no_grad():
        broken.parameters_[0] = float("nan")
    with refused("segments.0.parameters_"):
        save_flow(Flow(broken), path)

    class Mine(Flow):
        pass

    with refused("Mine", "flow.fields()"):
        save_flow(Mine(torch.sin), path)
    with refused("Flow", "FourierField"):
        save_flow(broken, path)
    with refused("257 segments"):
        save_flow(Flow([torch.sin] * 257), path)
    with refused("none", kind=OutputError):
        save_flow(Flow(torch.sin), tmp_path / "none" / "flow")
    assert not list(tmp_path.iterdir())


def good(tmp_path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Header and tensors of a file with a field of every kind."""
    group = identification_group("torus")
    fields = [filled(FourierField(group, 2), 1), filled(neural_field(group, hidden=(4,)), 2)]
    data = save_flow(Flow(fields, steps=2), tmp_path / "good").read_bytes()
    length = int.from_bytes(data[:8], "little")
    return json.loads(json.loads(data[8 : 8 + length])["__metadata__"]["orbiflow"]), load(data)


def at(*keys: Any, to: Any) -> Callable[[dict[str, Any], dict[str, Tensor]], None]:
    """Sets one entry of the header."""

    def change(header: dict[str, Any], _: dict[str, Tensor]) -> None:
        place: Any = header
        for key in keys[:-1]:
            place = place[key]
        place[keys[-1]] = to

    return change


NESTED: Any = {"kind": "symmetrized", "group": 0, "periodic": True}
NESTED["field"] = json.loads(json.dumps(NESTED | {"field": {"kind": "own", "name": "x"}}))
DEEP: Any = {"kind": "own", "name": "x"}
for _ in range(20):
    DEEP = {"kind": "symmetrized", "group": 0, "periodic": True, "field": DEEP}

HOSTILE: dict[str, Callable[[dict[str, Any], dict[str, Tensor]], object]] = {
    **{"format": at("format", to="orbiflow-flow/9"), "no segments": at("segments", to=[])},
    **{"segments": at("segments", to="many"), "kind": at("segments", 0, "kind", to="pickle")},
    **{"steps": at("steps", to=10**12), "half a step": at("steps", to=0.5)},
    **{"method": at("method", to="leap"), "duration": at("duration", to="long")},
    "frequency": at("segments", 0, "max_frequency", to=600),
    "wrong frequency": at("segments", 0, "max_frequency", to=3),
    "parameters": at("segments", 0, "parameters", to=10**9),
    **{"batch": at("segments", 0, "batch", to=10**9), "group": at("segments", 0, "group", to=7)},
    "dtype": at("segments", 0, "dtype", to="int64"),
    "lattice": at("groups", 0, "lattice", to=[[1, 1], [1, 1]]),
    "no lattice": at("groups", 0, "lattice", to=None),
    "cosets": at("groups", 0, "linear", to=[[[1, 0], [0, 1]]] * 3000),
    "same coset": lambda h, _: h["groups"][0].update(
        linear=[[[1, 0], [0, 1]]] * 2, translations=[[0, 0], [0, 0]]
    ),
    "groups": at("groups", to=[{}] * 100),
    "no group": at("groups", to=[{}]),
    "deep": at("segments", 0, to=DEEP),
    "own": at("segments", 0, to={"kind": "own", "name": "os.system"}),
    "forward": at("segments", 0, to={"kind": "same", "segment": 1}),
    "width": at("segments", 1, "field", "sizes", to=[10**6, 2]),
    "layers": at("segments", 1, "field", "sizes", to=[2] * 1000),
    "waves": at("segments", 1, "field", "max_frequency", to=10**5),
    "missing": lambda _, t: t.pop("segments.0.parameters_"),
    "more": lambda _, t: t.update(more=torch.ones(3)),
    "shape": lambda _, t: t.update({"segments.1.field.1.bias": torch.ones(9)}),
    "nan": lambda _, t: t["segments.0.parameters_"].fill_(float("nan")),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_hostile_files_are_refused(case: str, tmp_path: Path) -> None:
    header, tensors = good(tmp_path)
    HOSTILE[case](header, tensors)
    bad = tmp_path / "bad.safetensors"
    bad.write_bytes(sealed(save(tensors, metadata={"orbiflow": json.dumps(header)})))
    with refused(bad, kind=InputFileError):
        load_flow(bad)


def headed(text: bytes) -> bytes:
    return len(text).to_bytes(8, "little") + text + b"\0" * 8


def test_files_that_are_no_flow(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with refused("file", kind=InputFileError):
        load_flow(path)
    with refused("directory", kind=InputFileError):
        load_flow(tmp_path)
    for data in (
        *(b"", b"\0" * 100, b"PK\3\4", (2**63).to_bytes(8, "little") + b"{}", headed(b"[]")),
        headed(b"7"),
    ):
        path.write_bytes(data)
        with refused("file", kind=InputFileError):
            load_flow(path)
    path.write_bytes(save({"x": torch.ones(2)}, metadata={"orbiflow": "[" * 100_000}))
    with refused("file", kind=InputFileError):
        load_flow(path)
    with path.open("wb") as file:
        file.truncate(300 * 2**20)
    with refused("314,572,800", "268,435,456", kind=InputFileError):
        load_flow(path)


def test_every_flipped_bit_is_found(tmp_path: Path) -> None:
    flow = Flow(filled(FourierField(wallpaper_group("pg"), 1), 1), steps=1)
    path = save_flow(flow, tmp_path / "flow")
    whole = path.read_bytes()
    said = set()
    for bit in range(0, 8 * len(whole), 7):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        with refused("flow", kind=InputFileError) as caught:
            load_flow(path)
        said.add("does not match" in str(caught.value))
    assert said == {True, False}
    for cut in (1, 8, 100):
        path.write_bytes(whole[:-cut])
        with refused("flow", kind=InputFileError):
            load_flow(path)


def test_a_file_without_a_checksum_says_what_to_do(tmp_path: Path) -> None:
    header, tensors = good(tmp_path)
    header.pop("checksum")
    path = tmp_path / "old.safetensors"
    path.write_bytes(save(tensors, metadata={"orbiflow": json.dumps(header)}))
    with refused("old.safetensors", kind=InputFileError):
        load_flow(path)
