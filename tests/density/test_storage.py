"""Densities on disk: what is read is what was saved, and what cannot be saved is refused by name."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

import orbiflow.density as od
from density.blends import blended, bump, stored
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.fields import FourierField, InvariantField, SplineField
from orbiflow.flows import Flow
from refusals import refused
from sealed import sealed
from strategies import seeds

SPACES = ("torus", "sphere", "klein-bottle", "projective-plane")


def filled(field: InvariantField, seed: int, size: float = 0.05) -> InvariantField:
    """With random parameters."""
    values = np.random.default_rng(seed).normal(size=tuple(field.parameters_.shape))
    with torch.no_grad():
        field.parameters_.copy_(size * torch.tensor(values))
    return field


def plain(*fields: InvariantField, space=None, base=None) -> od.Density:
    return od.FlowDensity(space or od.Torus(2), Flow(fields, steps=2, warn=False), base)


@given(
    name=st.sampled_from(SPACES),
    seed=seeds,
    segments=st.lists(
        st.tuples(st.sampled_from([FourierField, SplineField]), st.integers(1, 3), st.floats(0, 4)),
        min_size=1,
        max_size=3,
    ),
    von_mises=st.booleans(),
)
def test_what_is_read_is_what_was_saved(
    name: str, seed: int, segments, von_mises: bool, tmp_path_factory
) -> None:
    space = od.make_space(name)
    fields = [
        filled(kind(space.group, frequency, smoothness=smoothness), seed + k)
        for k, (kind, frequency, smoothness) in enumerate(segments)
    ]
    base = bump(space, 1.5) if von_mises else None
    density = plain(*fields, space=space, base=base)
    at = space.uniform(20, torch.Generator().manual_seed(seed))
    again = stored(density, tmp_path_factory.mktemp("saved"))
    with torch.no_grad():
        assert torch.equal(again.log_prob(at), density.log_prob(at))


class Tilted(od.Density):
    """Not one of orbiflow's."""

    def log_chart(self, points):
        return 50 * (2 * math.pi * points[..., 0]).cos()

    def draw(self, count, generator):
        return torch.rand(count, 2, dtype=torch.float64, generator=generator)


class TiltedUniform(od.UniformDensity, Tilted):
    """Looks like one of orbiflow's."""


class Doubled(od.FlowDensity):
    """Another density than its flow's."""


class OtherTorus(od.Torus):
    """A space of the same name."""


torus = od.Torus(2)
REFUSED = {
    "density Doubled": lambda: Doubled(torus, Flow(FourierField(torus.group, 1))),
    "base Tilted,": lambda: plain(FourierField(torus.group, 1), base=Tilted(torus)),
    "base TiltedUniform": lambda: plain(FourierField(torus.group, 1), base=TiltedUniform(torus)),
    "base Sphere": lambda: plain(FourierField(torus.group, 1), base=od.UniformDensity(od.Sphere())),
    "space OtherTorus": lambda: plain(FourierField(torus.group, 1), space=OtherTorus(2)),
    "segments.0 flow function": lambda: od.FlowDensity(torus, Flow(lambda x: 0 * x)),
    "finite": lambda: plain(filled(FourierField(torus.group, 1), 0, math.nan)),
    "segments 2000000": lambda: od.FlowDensity(
        torus, Flow(FourierField(torus.group, 1), steps=2_000_000)
    ),
    "kernels Torus": lambda: blended(
        od.Sphere(),
        Flow(FourierField(od.Sphere().group, 1)),
        od.UniformDensity(od.Sphere()),
        od.AdaptiveKernels(torus, torch.rand(1, 2), torch.ones(1, 2), torch.ones(1)),
        torch.full((3,), 1 / 3),
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_cannot_be_saved_is_refused_by_name(message: str) -> None:
    with refused(*message.split()):
        od.density_to_bytes(REFUSED[message]())


@pytest.mark.parametrize(
    "extra",
    [{"a": math.nan}, {"a": torch.ones(1)}, {"a": "long" * 2**18}],
    ids=["nan", "tensor", "long"],
)
def test_extras_that_would_not_be_read_again(extra) -> None:
    with pytest.raises(OrbiflowError, match=r"JSON|header"):
        od.density_to_bytes(plain(FourierField(torus.group, 1)), **extra)


FORMS = {
    "flow": lambda: plain(filled(FourierField(torus.group, 2), 1)),
    "kernels": lambda: od.AdaptiveKernels(
        torus, torch.rand(5, 2).double(), 9 * torch.ones(5, 2).double(), torch.ones(5).double() / 5
    ),
}


@pytest.mark.parametrize("form", FORMS)
def test_every_flipped_bit_is_found(form: str, tmp_path: Path) -> None:
    whole = od.density_to_bytes(FORMS[form](), columns=["a", "b"])
    path = tmp_path / "density.safetensors"
    path.write_bytes(whole)
    assert od.read_density(path)[1] == {"columns": ["a", "b"]}
    for bit in np.random.default_rng(0).integers(0, 8 * len(whole), 400).tolist():
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        path.write_bytes(data)
        with pytest.raises(InputFileError, match=r"damaged|checksum"):
            od.read_density(path)


DATA = np.random.default_rng(1).normal(20, 10, (100, 2))


def test_files_that_are_no_density(tmp_path) -> None:
    path = tmp_path / "density.safetensors"
    with refused("read", kind=InputFileError):
        od.read_density(path)
    estimator = od.DensityEstimator(
        "torus", unit="degrees", components="flow", max_frequency=1, segments=1, iterations=0
    ).fit(DATA)
    good = od.density_to_bytes(estimator.density_)
    length = int.from_bytes(good[:8], "little")
    outer = json.loads(good[8 : 8 + length])

    def changed(edit) -> bytes:
        header = json.loads(outer["__metadata__"]["orbiflow"])
        edit(header)
        text = json.dumps(outer | {"__metadata__": {"orbiflow": json.dumps(header)}}).encode()
        return sealed(len(text).to_bytes(8, "little") + text + good[8 + length :])

    bad = [
        b"",
        b"hello world, this is no density",
        changed(lambda h: h.update(format="orbiflow-tile/1")),
        changed(lambda h: h["space"].update(name="moebius")),
        changed(lambda h: h["space"].update(dim=40)),
        changed(lambda h: h["density"]["flow"]["segments"][0].update(max_frequency=10**6)),
        changed(lambda h: h["density"]["flow"]["segments"][0].update(max_frequency=2)),
        changed(lambda h: h["density"]["flow"]["segments"][0].update(smoothness=math.nan)),
        changed(lambda h: h["density"]["flow"].update(duration=math.inf)),
        changed(lambda h: h["density"]["base"].update(kind="normal")),
        changed(lambda h: h.pop("group")),
        changed(lambda h: h["group"].update(lattice=[[1.0, 1.0], [0.0, 1.0]])),
        changed(lambda h: h["group"].update(linear=[[[0.0, 1.0], [1.0, 0.0]]])),
        changed(lambda h: h["group"].update(translations="none")),
        changed(lambda h: h["density"]["flow"].update(steps=10**9)),
        changed(lambda h: h["density"].pop("base")),
    ]
    for content in bad:
        path.write_bytes(content)
        with refused("density", "orbiflow", kind=InputFileError):
            od.read_density(path)
