"""Densities on maps: what is seen where, what the words say, nothing cut off."""

import io
import math
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
import pytest
import torch
from PIL import Image

import orbiflow.density as od
from known_densities import kernels_about
from orbiflow.density.pictures.colours import density_at, density_over, round_pixel
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import EqualEarth, Lambert
from orbiflow.drawing import NARROWEST, Sheet, pdf_pages
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from printed import check_inside, letters
from refusals import names, refused

on_a_map = partial(od.density_picture, ground="map")

COAST = [np.array([[10.0, 160.0], [20.0, -170.0], [0.0, -150.0]])]


@pytest.fixture(name="coast")
def coast_file(tmp_path: Path) -> Path:
    path = tmp_path / "coast.csv"
    np.savetxt(path, COAST[0], delimiter=",")
    return path


ROUND = [od.Sphere(), od.ProjectivePlane()]
every_space = pytest.mark.parametrize("space", ROUND, ids=lambda s: s.name)


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbiflow.density.pictures.maps._PIXELS", 3000)
    monkeypatch.setattr("orbiflow.density.pictures.colours._COARSE", 24)


def peaked(space: od.RoundSpace, at: tuple[float, float], kappa: float) -> od.Mixture:
    return kernels_about(space, [at], [kappa], [1.0])


def points(count: int) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(0).uniform(0, 1, (count, 2)))


@every_space
@pytest.mark.parametrize("kappa", [5.0, 300.0, 1e6])
def test_a_map_has_the_peak_where_it_is_and_all_the_mass(
    space: od.RoundSpace, kappa: float
) -> None:
    at = (37.0, -120.0)
    projection = EqualEarth((0.0, 100.0)) if space.name == "sphere" else Lambert((60.0, 0.0))
    ground = Map(space, projection)
    drawn = ground.colouring(peaked(space, at, kappa), od.PlotSettings(scale="linear"), 3000)
    pixels = ground.pixels(3000)
    values, within = drawn.places[pixels.shown] * drawn.shade.high, pixels.within
    assert values[within].sum() * float(pixels.side(pixels.points)) ** 2 == pytest.approx(
        1.0, abs=0.05
    )
    best = od.to_latlon(space.vectors(pixels.points))[within][values[within].argmax()]
    cosine = float(np.prod(od.to_vectors([at, best]), axis=0).sum())
    assert (cosine if space.name == "sphere" else abs(cosine)) > math.cos(0.1)


@every_space
def test_kernels_are_summed_as_finely_as_a_picture_needs(space: od.RoundSpace) -> None:
    rng = np.random.default_rng(1)
    count = 200
    centers = space.to_chart(
        np.stack([rng.uniform(-80, 80, count), rng.uniform(-180, 180, count)], 1)
    )
    kappa = torch.tensor(10 ** rng.uniform(0, 4, (count, 1)))
    weights = torch.full((count,), 1 / count, dtype=torch.float64)
    kernels = od.AdaptiveKernels(space, centers, kappa, weights)
    density = od.Mixture([kernels, od.UniformDensity(space)], [0.99, 0.01])
    found = density_over(density, points(300), "natural", round_pixel(1e-9))
    np.testing.assert_allclose(found, density_at(density, points(300), "natural"), rtol=1e-4)


@pytest.mark.parametrize(("space", "width"), [(ROUND[0], NARROWEST), (ROUND[1], "single")])
def test_maps_have_room_and_letters_of_7_to_8_points(space: Any, width: Any) -> None:
    density, sheet = peaked(space, (20, 30), 50.0), replace(Sheet.column(width), dpi=100)
    asked: list[Any] = [{"projection": p} for p in ("schmidt", "wulff")]
    if space.name == "sphere":
        asked = [{"projection": p, "center": (150,)} for p in ("mollweide", "latlon")]
        asked += [{"projection": "lambert", "center": (-25, 130), "radius": 20}]
    pictures = [
        on_a_map(density, points(30), od.PlotSettings(**options), sheet=sheet) for options in asked
    ]
    for picture in pictures:
        check_inside(picture)
    pdf = pdf_pages(pictures)
    assert all(7 <= size <= 8 for size in letters(pdf))
    pages = list(pypdfium2.PdfDocument(pdf))
    assert len(pages) == len(asked)
    for page in pages:
        kinds = [pdfium.FPDFPageObj_GetType(item) for item in page.get_objects()]
        assert kinds.count(pdfium.FPDF_PAGEOBJ_IMAGE) <= 2  # the map and the bar: no cells to sew
        assert page.get_width() == pytest.approx(72 * sheet.width, abs=0.01)
    for data in (points(30), None):
        check_inside(od.samples_picture(density, data, points(20), sheet=sheet, ground="map"))


def test_what_is_outside_the_outline_is_paper_and_inside_is_colour() -> None:
    picture = on_a_map(
        peaked(ROUND[0], (0, 0), 2.0),
        settings=od.PlotSettings(projection="mollweide", scale="linear", earth=False),
    )
    image = np.asarray(Image.open(io.BytesIO(picture.file())).convert("RGB")).astype(int)
    axes = picture.figure.axes[1] if len(picture.figure.axes) > 1 else picture.figure.axes[0]
    axes = max(picture.figure.axes, key=lambda a: a.get_position().height)
    height = image.shape[0]

    def colour(x: float, y: float) -> np.ndarray:
        place = axes.transData.transform((x, y))
        return image[int(height - place[1]), int(place[0])]

    side, top = 2 * math.sqrt(2), math.sqrt(2)
    assert (colour(-0.95 * side, 0.8 * top) == 255).all()
    for turn in np.linspace(0.1, 6.2, 20):
        x, y = 0.97 * side * math.cos(turn), 0.97 * top * math.sin(turn)
        assert (colour(x, y) < 255).any()


def test_captions_say_what_is_seen(coast: Path) -> None:
    sphere = peaked(ROUND[0], (20, 30), 500.0)
    shown = od.PlotSettings(center=(150,), samples=20, coastlines=coast)
    words = on_a_map(sphere, points(50), shown).caption
    names(words, "Equal Earth", "150° E", "coastlines", "20 of 50", "logarithmic", "99 %")
    asked = on_a_map(sphere, settings=od.PlotSettings(scale="linear", earth=False)).caption
    names(asked, "linear")
    assert "coastlines" not in asked
    names(on_a_map(peaked(ROUND[0], (0, 0), 1e7)).caption, "narrower than")
    plane = peaked(ROUND[1], (20, 30), 5.0)
    net = on_a_map(plane, settings=od.PlotSettings(projection="schmidt"))
    names(net.caption, "Lower hemisphere", "Schmidt net", "linear")
    names(on_a_map(peaked(od.Sphere(form="vector"), (20, 30), 5.0)).caption, "x, y plane")


def test_coastlines_are_drawn_and_cut(coast: Path) -> None:
    density = peaked(ROUND[0], (20, 30), 5.0)
    plain, lines = (
        on_a_map(density, settings=od.PlotSettings(projection="latlon", coastlines=path)).file()
        for path in (None, coast)
    )
    assert plain != lines


def test_maps_of_other_spaces_are_refused() -> None:
    space = od.Torus(2)
    density = od.FlowDensity(space, Flow([FourierField(space.group, 1)], steps=1))
    with refused("maps", "sphere"):
        on_a_map(density)
