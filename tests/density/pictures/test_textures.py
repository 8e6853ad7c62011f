"""Pictures of textures: sectors, indices, panels, and what is refused."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from density.quick_fits import quick_pictures
from orbiflow.density import AdaptiveKernels, RotationSpace, plot_density
from orbiflow.density.inference import pole_density
from orbiflow.density.pictures import PlotSettings
from orbiflow.density.pictures.projections import Lambert
from orbiflow.density.pictures.textures import (
    UPWARDS,
    _edge,  # pyright: ignore[reportPrivateUsage]
    poles_picture,
    sections_picture,
)
from orbiflow.density.spaces import (
    ORIENTATIONS,
    fundamental_sector,
    indices_of,
    named_orientation,
    plane_normal,
    rotations_of,
    to_latlon,
)
from orbiflow.errors import SettingError
from refusals import refused
from strategies import seeds

CRYSTALS = ["C1", "C2", "C2x", "C2y", "D2", "C3", "D3", "D3y", "C4", "D4", "C6", "D6", "T", "O"]


def cube(kappa: float = 60.0, symmetry: str = "O", specimen: str = "D2") -> AdaptiveKernels:
    space, one = (
        RotationSpace(symmetry=symmetry, specimen=specimen),
        torch.ones(1, dtype=torch.float64),
    )
    center = torch.tensor([[0.0, 0.0, 0.0, 1.0]], dtype=torch.float64)
    return AdaptiveKernels(space, center, kappa * one[:, None], one)


@pytest.mark.parametrize("symmetry", CRYSTALS)
def test_every_direction_has_one_image_in_the_sector(symmetry: str) -> None:
    from matplotlib.path import Path

    sector, net = fundamental_sector(symmetry), Lambert(UPWARDS)
    edge = net.outline() if sector.whole else _edge(net, sector.corners)
    ways = np.random.default_rng(0).normal(size=(400, 3))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    images = np.stack([turn.apply(ways) for turn in rotations_of(symmetry)])
    images = np.concatenate([images, -images]).reshape(-1, 3)
    upper = images[:, 2] > 0
    inside = np.zeros(len(images), dtype=bool)
    inside[upper] = Path(edge).contains_points(net.forward(to_latlon(images[upper])))
    counts = inside.reshape(-1, 400).sum(axis=0)
    # a few are within the width of a line of the edge
    assert (counts == 1).mean() > 0.98


@given(seed=seeds, symmetry=st.sampled_from(["C3", "D3", "D6", "D4", "D2", "O"]))
@settings(max_examples=20)
def test_normals_of_planes_are_at_right_angles_to_them(seed: int, symmetry: str) -> None:
    rng = np.random.default_rng(seed)
    h, k, m = (int(v) for v in rng.integers(1, 5, 3))
    a, c = rng.uniform(1, 2, 2)
    b = rng.uniform(1, 2) if symmetry == "D2" else a
    hexagonal = symmetry in ("C3", "D3", "D6")
    angle = math.radians(120 if hexagonal else 90)
    axes = np.array([[a, 0, 0], [b * math.cos(angle), b * math.sin(angle), 0], [0, 0, c]])
    if symmetry == "O":
        axes = a * np.eye(3)
    ends = axes / np.array([[h], [k], [m]])  # where the plane cuts the axes
    indices = (h, k, -h - k, m) if hexagonal else (h, k, m)
    normal = plane_normal(indices, symmetry, (a, b, c))
    assert (ends[1] - ends[0]) @ normal == pytest.approx(0, abs=1e-12)
    assert (ends[2] - ends[0]) @ normal == pytest.approx(0, abs=1e-12)
    assert ends[0] @ normal > 0


BUNGE = {
    "cube": (0, 0, 0), "goss": (0, 45, 0), "brass": (35.26, 45, 0), "copper": (90, 35.26, 45),
    "s": (58.98, 36.70, 63.43),
}  # fmt: skip


@pytest.mark.parametrize("name", ORIENTATIONS)
def test_named_orientations_are_those_of_the_textbook(name: str) -> None:
    turns = named_orientation(name)
    images = [turns * turn for turn in rotations_of("O")]
    images = Rotation.concatenate([left * one for left in rotations_of("D2") for one in images])
    wanted = Rotation.from_euler("ZXZ", BUNGE[name], degrees=True)
    assert np.degrees((images * wanted.inv()).magnitude().min()) < 0.05


def test_indices_that_are_none_are_refused() -> None:
    for text in ("", "1", "12", "1-", "11-11", "000", "x", "10-11-1"):
        with refused("001", kind=SettingError):
            indices_of(text)
    with refused("indices", "hexagonal", kind=SettingError):
        plane_normal((1, 0, -1, 1), "O")
    with refused("1", "1.587", kind=SettingError):
        plane_normal((1, 0, -1, 1), "D6")
    with refused("equal", kind=SettingError):
        plane_normal((1, 0, 1), "D4", (1, 2, 3))


def test_panels_show_the_density_that_was_integrated() -> None:
    density = cube()
    picture = poles_picture(density, None, PlotSettings(pole=("001", "1-11")))
    panels = [axes for axes in picture.figure.axes if axes.images and axes.get_title()]
    assert [axes.get_title().split()[0] for axes in panels] == ["{001}", "{11\u03041}"]
    top = pole_density(density, [0, 0, 1], [[0, 0, 1]])[0][0]
    assert panels[0].get_title().endswith(f"{top:.3g}")
    assert "Crystals 432, specimen 222" in picture.caption
    array: Any = panels[0].images[0].get_array()
    middle = np.unravel_index(int(np.argmax(array)), array.shape)
    # z in the middle, x and y on the rim are the poles of a cube in its own axes
    assert middle == (50, 50)
    assert array[50, 0] > 0.5
    assert array[0, 50] > 0.5
    assert array[25, 25] < 0.1
    sections = sections_picture(density, None, PlotSettings(sections=(0.0, 30.0)))
    panels = [axes for axes in sections.figure.axes if axes.images and axes.get_title()]
    assert panels[1].get_title().startswith("phi2 = 30\u00b0")
    # at Phi = 0 both angles turn about z: the cube is where their sum is a quarter turn
    array = panels[1].images[0].get_array()
    assert array.shape == (60, 60)
    assert np.unravel_index(int(np.argmax(array)), array.shape) in ((59, 39), (59, 40))
    assert panels[1].get_ylim() == (90, 0)


@pytest.mark.parametrize(("symmetry", "specimen"), [("D6", "C1"), ("C2y", "C1"), ("C1", "D2")])
def test_every_symmetry_has_its_pictures(
    symmetry: str, specimen: str, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    quick_pictures(monkeypatch)
    density = cube(20.0, symmetry, specimen)
    data = density.space.from_chart(density.sample((30,), torch.Generator().manual_seed(0)))
    plotted = plot_density(density, tmp_path, PlotSettings(dots=True), data=data)
    assert [path.name for path in plotted.files] == ["poles.png", "inverse.png", "sections.png"]


WRONG = {
    "projection": (PlotSettings(projection="mollweide"), "schmidt lambert"),
    "center": (PlotSettings(center=(0.0,)), "center"),
    "four": (PlotSettings(pole=("10-11",)), "four indices"),
    "lattice": (PlotSettings(lattice=(1.0,)), "three lengths"),
    "specimen": (PlotSettings(inverse=("up",)), "inverse"),
    "regions": (PlotSettings(regions=(0.5,)), "regions"),
}


@pytest.mark.parametrize("name", WRONG)
def test_settings_that_do_not_fit_are_refused(name: str, tmp_path: Any) -> None:
    asked, message = WRONG[name]
    with refused(*message.split()):
        plot_density(cube(), tmp_path, asked)
