"""Spheres of any dimension, axes, rotations and crystals: kernels, groups, forms, fits and commands."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import kstest

import orbiflow.density as od
from density.blends import kernels_of, random_kernels, stored
from orbiflow.density.fitting import Rows
from orbiflow.density.fitting.chains import concentration
from orbiflow.density.fitting.kernels import fit_mixture, kernel_estimates
from orbiflow.density.spaces import UnitVectorSpace
from orbiflow.errors import InputFileError
from orbiflow.runtime import find, tensor_bytes
from refusals import refused
from strategies import seeds

SPACES: tuple[UnitVectorSpace, ...] = (
    *map(od.Hypersphere, (1, 2, 3, 9)), *map(od.ProjectiveSpace, (1, 4)), od.RotationSpace(),
    od.RotationSpace(form="ZXZ", unit="degrees", symmetry="D6"),
    od.RotationSpace(form="vector", symmetry="O"),
)  # fmt: skip
every = pytest.mark.parametrize("space", SPACES, ids=repr)
dims = st.integers(1, 64)


def source(seed: int) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def kernels(space: od.Space, seed: int, low: float = 1.0, high: float = 60.0) -> od.AdaptiveKernels:
    return random_kernels(np.random.default_rng(seed), space, 4, low, high)


def one_kernel(dim: int, kappa: float) -> od.AdaptiveKernels:
    space = od.Hypersphere(dim)
    pole = torch.eye(dim + 1, dtype=torch.float64)[-1:]
    one = torch.ones(1, dtype=torch.float64)
    return od.AdaptiveKernels(space, pole, kappa * one[:, None], one)


@every
def test_the_elements_are_a_group_and_the_volume_is_that_of_the_sphere_among_them(
    space: UnitVectorSpace,
) -> None:
    elements = space.elements
    products = torch.einsum("aij,bjk->abik", elements, elements).flatten(0, 1)
    apart = (products[:, None] - elements).abs().amax(dim=(2, 3))
    assert bool(((apart < 1e-9).sum(dim=1) == 1).all())
    p = space.dim + 1
    wanted = 2 * math.pi ** (p / 2) / math.gamma(p / 2) / len(elements)
    assert space.volume == pytest.approx(wanted)


@settings(max_examples=12)
@given(dim=st.integers(1, 12), log=st.floats(-2, math.log(1e7)), seed=seeds)
def test_heights_of_samples_have_their_distribution(dim: int, log: float, seed: int) -> None:
    kappa = math.exp(log)
    drawn = one_kernel(dim, kappa).sample(300, source(seed))
    angle = np.asarray(2 * torch.asin((drawn - torch.eye(dim + 1)[-1]).norm(dim=1) / 2))
    grid = np.linspace(0, min(math.pi, 12 * (dim / kappa) ** 0.5), 20_001)[1:]
    logs = -2 * kappa * np.sin(grid / 2) ** 2 + (dim - 1) * np.log(np.sin(grid).clip(1e-300))
    mass = np.cumsum(np.exp(logs - logs.max()))
    assert kstest(angle, lambda t: np.interp(t, grid, mass / mass[-1])).pvalue > 1e-7


@given(dim=dims, log=st.floats(-2, math.log(1e6)))
def test_concentrations_come_back_from_mean_cosines(dim: int, log: float) -> None:
    kappa = math.exp(log)
    with mpmath.workdps(40):
        half = mpmath.mpf(dim + 1) / 2
        cosine = float(mpmath.besseli(half, kappa) / mpmath.besseli(half - 1, kappa))
    if 1e-4 <= cosine <= 1 - 1e-8:  # beyond, they are held
        found = float(concentration(torch.tensor([cosine], dtype=torch.float64), dim))
        assert found == pytest.approx(kappa, rel=1e-6 + 1e-15 * kappa)


def test_two_dimensions_are_the_sphere_and_rotations_are_projective_space() -> None:
    noise = np.random.default_rng(0).normal(size=(60, 4)) + np.array([1.5, 0.0, 0.5, 1.0])
    four = noise / np.linalg.norm(noise, axis=1, keepdims=True)
    three = noise[:, :3] / np.linalg.norm(noise[:, :3], axis=1, keepdims=True)
    pairs: list[tuple[od.Space, od.Space, np.ndarray]] = [
        (od.Hypersphere(2), od.Sphere(form="vector"), three),
        (od.ProjectiveSpace(2), od.ProjectivePlane(form="vector"), three),
        (od.ProjectiveSpace(3), od.RotationSpace(), four),
    ]
    for one, other, data in pairs:
        scores: list[torch.Tensor] = []
        for space in (one, other):
            points = space.to_chart(data)
            near = kernel_estimates(space, Rows(points))["near 8, 0.4, 1"]
            few = fit_mixture(space, Rows(points), 2, generator=source(0))
            found = [part.log_prob(points, measure="natural") for part in (near, few)]
            scores.append(torch.cat(found))
        assert torch.allclose(scores[0], scores[1], atol=1e-6)
        assert one.volume == pytest.approx(other.volume)


@pytest.mark.parametrize("dim", [2, 5, 9])
def test_kernels_are_neither_spikes_nor_flat_in_any_dimension(dim: int) -> None:
    truth = one_kernel(dim, 8.0 * dim)
    data, fresh = truth.sample(300, source(dim)), truth.sample(500, source(99))
    fit = od.DensityEstimator(truth.space, components="kernels").fit(data.numpy())
    gain = float(truth.log_prob(fresh, measure="uniform").mean())
    found = float(fit.density_.log_prob(fresh, measure="uniform").mean())
    assert 0.8 * gain < found < gain
    # Silverman's rule for a Gaussian of this width and this many rows
    rule = 8 * dim * (300 * (dim + 2) / 4) ** (2 / (dim + 4))
    part = kernels_of(fit.density_)
    typical = float((part.weights * part.concentrations[:, 0].log()).sum().exp())
    assert sum(weight for weight, own in fit.density_.parts() if own is part) > 0.9
    assert rule / 4 < typical < 4 * rule


class HalfTurns(UnitVectorSpace):
    """The sphere modulo half turns about its axis."""

    name, columns = "half-turns", ("x", "y", "z")

    def __init__(self) -> None:
        super().__init__(np.stack([np.eye(3), np.diag([-1.0, -1.0, 1.0])]))

    @classmethod
    def for_data(cls, data: np.ndarray, *, unit: str = "radians", seed: int = 0) -> HalfTurns:
        del data, unit, seed
        return cls()

    def settings(self) -> dict[str, Any]:
        return {}


def test_the_quotient_by_a_group_of_ones_own_is_fitted_and_saved(tmp_path: Path) -> None:
    truth = kernels(HalfTurns(), 1)
    data = truth.sample(60, source(0)).numpy()
    fit = od.DensityEstimator("half-turns", components="mixture").fit(data)
    scores = fit.score_samples(data)
    assert fit.score_samples(data * [-1, -1, 1]) == pytest.approx(scores)
    again = od.DensityEstimator.fitted(stored(fit.density_, tmp_path))
    assert isinstance(again.space_, HalfTurns)
    assert (again.score_samples(data) == scores).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"name": "hypersphere", "dim": 10**9}, "dim 1 64"),
        ({"name": "hypersphere", "dim": 4}, "hypersphere"),
        ({"name": "rotation-space", "form": "ZZZ"}, "form"),
        ({"name": "rotation-space", "symmetry": "C999999"}, "symmetry"),
    ],
)
def test_hostile_files_are_refused(options: dict[str, object], message: str, tmp_path) -> None:
    header = {
        "format": "orbiflow-density/6",
        "space": options,
        "group": None,
        "density": {"kind": "kernels", "kernels": 1},
        "extra": {},
    }
    one = torch.ones(1, dtype=torch.float64)
    tensors = {"centers": torch.eye(4)[:1], "concentrations": one[:, None], "weights": one}
    path = tmp_path / "x.safetensors"
    path.write_bytes(tensor_bytes(header, {k: v.double() for k, v in tensors.items()}, "a density"))
    with refused(*message.split(), kind=InputFileError):
        od.read_density(path)


space3, quarter = od.Hypersphere(3), [[0.0, 0.0, math.pi / 2]]
REFUSED = {
    "row 2 length": lambda: space3.to_chart([[0, 0, 0, 1.0], [0, 0, 0, 2.0]]),
    "array 4": lambda: space3.to_chart([[0.0, 0.0, 1.0]]),
    "unit vectors": lambda: kernels(space3, 0).log_prob(torch.zeros(1, 4)),
    "1 latitude longitude": lambda: od.Hypersphere(1).to_chart([[31.1, 35.5]]),
    "row 1 matrix": lambda: od.RotationSpace().to_chart([[1.0] * 9]),
    "row 1 turn radians": lambda: od.RotationSpace().to_chart([[0.0, 0.0, 90.0]]),
    "turn degrees": lambda: od.RotationSpace(form="ZXZ", unit="degrees").to_chart(
        [[400.0, 0.0, 0.0]]
    ),
    "gradients quaternions": lambda: od.DensityEstimator.fitted(
        kernels(od.RotationSpace(), 0)
    ).score_gradient(quarter),
    "flow hypersphere 3": lambda: od.DensityEstimator(space3, components=("flow", "kernels")).fit(
        space3.uniform(20, source(0))
    ),
    "max_frequency hypersphere": lambda: od.DensityEstimator(space3, max_frequency=3).fit(
        np.eye(4)
    ),
    "picture hypersphere": lambda: od.density_picture(kernels(od.Hypersphere(2), 0)),
    "hypersphere option": lambda: od.make_space("hypersphere", unit="degrees"),
}


@pytest.mark.parametrize("message", REFUSED)
def test_what_has_no_meaning_is_refused(message: str) -> None:
    with refused(*message.split()):
        REFUSED[message]()


def test_the_commands_fit_score_sample_and_find_regions_of_rotations(tmp_path: Path) -> None:
    turns = Rotation.from_rotvec(np.random.default_rng(0).normal(0, 0.3, (80, 3)))
    table, folder = tmp_path / "turns.csv", tmp_path / "fit"
    np.savetxt(table, turns.as_rotvec(degrees=True), delimiter=",", header="rx,ry,rz", comments="")

    def run(name: str, **given: object) -> dict[str, object]:
        call = find(f"density {name}").call(given)
        return dict(call.run().summary)

    where = {"space": "rotation-space", "data": table}
    with refused("rx", "angle:degrees", kind=od.UndeclaredError):
        run("fit", **where, out=folder)
    run("fit", **where, unit="degrees", out=folder, picture=True)
    assert (folder / "thumbnail.png").exists()
    scored = run("score", data=table, model=folder, out=tmp_path / "scores.csv")
    density, extra = od.read_density(folder / "density.safetensors")
    assert extra["columns"] == ["rx", "ry", "rz"]
    points = density.space.to_chart(turns.as_quat())
    assert scored["mean"] == pytest.approx(float(density.log_prob(points).mean()))
    run("sample", model=folder, out=tmp_path / "drawn.csv", count=30)
    assert np.loadtxt(tmp_path / "drawn.csv", delimiter=",", skiprows=1).shape == (30, 3)
    found = run("region", model=folder, out=tmp_path / "regions.json", samples=1000)
    assert len(found["regions"]) == 2  # pyright: ignore[reportArgumentType]
    with refused("angles", "torus"):
        run("marginal", model=folder, out=tmp_path / "marginal", columns=("rx",))
    with refused("GeoJSON"):
        run("region", model=folder, out=tmp_path / "regions.geojson")
