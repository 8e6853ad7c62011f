"""Figures for print: their size, their texts, and that nothing is cut off or written over."""

import io
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pypdfium2
import pypdfium2.raw as pdfium
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from bent_tiles import bent_tile
from orbiflow.arrays import Array
from orbiflow.density import (
    Density,
    FlowDensity,
    KleinBottle,
    PlotSettings,
    ProjectivePlane,
    Sphere,
    Torus,
    UniformDensity,
    corner_picture,
    density_picture,
    flow_picture,
    samples_picture,
)
from orbiflow.drawing import NARROWEST, Picture, Sheet, field_picture, pdf_pages
from orbiflow.drawing.canvas import flow_lines, symmetric_seeds
from orbiflow.errors import OrbiflowError
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.tiles import bending_picture, isohedral_class, overlay_picture, tiling_picture
from printed import check_inside, letters
from refusals import refused

SPACES = [Torus(2, unit="degrees"), KleinBottle(), Sphere(), ProjectivePlane()]


@pytest.fixture(autouse=True)
def _coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("orbiflow.density.pictures.square._GRID", 24)
    monkeypatch.setattr("orbiflow.density.pictures.colours._COARSE", 24)
    monkeypatch.setattr("orbiflow.drawing.canvas._SAMPLES", 20)


def coarse(width: Any) -> Sheet:
    """A sheet whose pixels are large: here texts and frames count."""
    return replace(Sheet.column(width), dpi=100)


def example(space: Any) -> Density:
    field = FourierField(space.group, 2, dtype=torch.float64)
    field.parameters_.data.normal_(0, 0.02, generator=torch.Generator().manual_seed(3))
    return FlowDensity(space, Flow([field], steps=2))


def points(count: int, dim: int = 2) -> torch.Tensor:
    return torch.tensor(np.random.default_rng(0).uniform(-2, 2, (count, dim)))


def corner(dim: int, sheet: Sheet) -> Picture:
    density = UniformDensity(Torus(dim))
    names = tuple(f"a long name {k}" for k in range(dim))
    settings = PlotSettings(names=names)
    return corner_picture(density, points(40, dim), points(30, dim), settings, sheet=sheet)


def test_the_narrowest_figure_has_room() -> None:
    names = ("a rather long name of an angle", "ψ")
    for measure, scale in (("uniform", "linear"), ("natural", "log")):
        settings = PlotSettings(names=names, measure=measure, scale=scale)  # pyright: ignore
        sheet = coarse(NARROWEST)
        check_inside(density_picture(example(SPACES[0]), settings=settings, sheet=sheet))


@pytest.mark.parametrize(("space", "width"), [(SPACES[0], "single"), (SPACES[2], "double")])
def test_density_figures_have_room_and_letters_of_7_to_8_points(space: Any, width: Any) -> None:
    density, sheet = example(space), coarse(width)
    names = ("a rather long name of an angle", "ψ") if space.unit else None
    made = [
        density_picture(
            density, points(50), PlotSettings(measure="uniform", names=names), sheet=sheet
        ),
        density_picture(density, settings=PlotSettings(scale="log"), sheet=sheet),
        flow_picture(density, sheet=sheet),
        samples_picture(density, points(60), points(40), sheet=sheet),
    ]
    for picture in made:
        check_inside(picture)
    pdf = pdf_pages(made)
    widths = [page.get_width() for page in pypdfium2.PdfDocument(pdf)]
    assert widths == pytest.approx([72 * sheet.width] * len(made), abs=0.01)
    check_letters(pdf)


def check_letters(pdf: bytes) -> None:
    assert all(7 <= size <= 8 for size in letters(pdf))
    assert b"/FontFile2" in pdf
    assert b"/Type3" not in pdf


@pytest.mark.parametrize(("dim", "width"), [(1, "single"), (3, "single"), (8, 120)])
def test_pairs_of_angles_have_room(dim: int, width: Any) -> None:
    picture = corner(dim, coarse(width))
    check_inside(picture)
    check_letters(picture.file())
    assert "40 data and 30 samples" in picture.caption


def test_too_many_angles_for_a_column_are_refused_with_the_width_that_they_need() -> None:
    with refused(8, "120 mm", "85 mm"):
        corner(8, Sheet.column("single"))


@pytest.mark.parametrize("space", [SPACES[0], SPACES[3]], ids=lambda s: s.name)
def test_an_svg_has_texts_as_texts_and_the_same_bytes_again(space: Any) -> None:
    sheet = Sheet.column("single", "svg")
    first, again = (density_picture(example(space), sheet=sheet).file() for _ in range(2))
    assert first == again
    svg = first.decode()
    assert re.search(">density, [^<]*per", svg)
    assert set(re.findall(r"font: (?:\w+ )?([\d.]+)px", svg)) <= {"7.2", "8"}
    assert re.search(r'width="240\.9\d*pt"', svg)


def test_a_printed_png_is_as_wide_as_it_says() -> None:
    sheet = Sheet.column(80, "png")
    image = Image.open(io.BytesIO(density_picture(example(SPACES[0]), sheet=sheet).file()))
    assert image.width == pytest.approx(80 / 25.4 * 600, abs=1)
    assert image.info["dpi"][0] == pytest.approx(600, abs=0.1)


def _written(figure: Any) -> str:
    axes = [own.get_title() for own in figure.axes]
    return " ".join([*axes, *(text.get_text() for text in figure.texts)])


def test_print_leaves_the_title_to_the_caption() -> None:
    printed = density_picture(example(SPACES[2]), points(9), sheet=Sheet.column())
    screen = density_picture(example(SPACES[2]), points(9))
    titles = ["Density on the sphere" in _written(own.figure) for own in (printed, screen)]
    assert titles == [False, True]
    assert "Squares are cone points of a quarter turn" in printed.caption
    text = pypdfium2.PdfDocument(printed.file()).get_metadata_dict()
    assert text["Title"] == "Density on the sphere"
    assert text["Subject"] == printed.caption


def test_pages_of_one_pdf() -> None:
    printed = density_picture(example(SPACES[0]), sheet=Sheet.column())
    pictures = [printed, flow_picture(example(SPACES[0]))]
    assert [p.sheet.format for p in pictures] == ["pdf", "png"]
    document = pypdfium2.PdfDocument(pdf_pages(pictures))
    assert [round(page.get_width()) for page in document] == [241, 576]


@given(st.floats(40, 1000), st.sampled_from(["png", "pdf", "svg"]))
@settings(max_examples=10)
def test_every_width_is_kept(width: float, form: Any) -> None:
    sheet = Sheet.column(width, form)
    assert sheet.width * 25.4 == pytest.approx(width)
    assert (sheet.text, sheet.format) == (8.0, form)
    assert 0.25 <= sheet.pen(1.0) <= width / 203.2 + 0.25


@pytest.mark.parametrize(
    ("width", "form", "message"),
    [
        ("triple", "pdf", "width must be single or double, got 'triple'"),
        (39.9, "pdf", "width must be from 40 to 1000, got 39.9"),
        (float("nan"), "pdf", "a finite number from 40 to 1000, got nan"),
        (True, "pdf", "a number from 40 to 1000, got True"),
        ("single", "eps", "format must be png, pdf or svg, got 'eps'"),
    ],
)
def test_other_sheets_are_refused(width: Any, form: Any, message: str) -> None:
    with pytest.raises(OrbiflowError, match=re.escape(message)):
        Sheet.column(width, form)


@pytest.mark.parametrize("y_down", [False, True])
def test_curves_show_what_the_pixels_show(y_down: bool) -> None:
    tile = bent_tile("IH6")
    picture = tiling_picture(tile, y_down=y_down, sheet=Sheet.column())
    pixels, pdf = np.asarray(picture.image(400), dtype=float), picture.file()
    page = pypdfium2.PdfDocument(pdf)[0]
    drawn = page.render(scale=1200 / page.get_width()).to_pil().convert("RGB")
    drawn = np.asarray(drawn.resize((400, pixels.shape[0]), Image.Resampling.BOX), dtype=float)
    apart = np.abs(drawn - pixels).max(axis=2)
    assert np.mean(apart > 60) < 0.02


def test_pictures_of_tiles_are_curves() -> None:
    tile = bent_tile("IH5", 7.0)
    goal = 1.02 * tile.polygon
    made = {
        "Dashed": bending_picture(tile, goal, tile.polygon, sheet=Sheet.column()),
        "Orange": overlay_picture(tile, goal, y_down=True, sheet=Sheet.column()),
    }
    for word, picture in made.items():
        page = pypdfium2.PdfDocument(picture.file())[0]
        kinds = {pdfium.FPDFPageObj_GetType(item) for item in page.get_objects()}
        assert kinds == {pdfium.FPDF_PAGEOBJ_PATH}
        assert page.get_width() == pytest.approx(72 * 85 / 25.4, abs=0.01)
        assert word in picture.caption


def test_a_field_has_lines_to_scale() -> None:
    tile, widths = bent_tile("IH4"), []
    for sheet in (Sheet.screen(1600), Sheet.column("single")):
        picture = field_picture(torch.zeros_like, tile.group, tile, sheet=sheet)
        widths.append(picture.figure.axes[0].lines[-1].get_linewidth())
        assert picture.file()
    assert widths[1] == pytest.approx(widths[0] * 85 / 25.4 / 8)


def test_a_notebook_shows_a_picture() -> None:
    shown = density_picture(example(SPACES[0]), sheet=Sheet.column())._repr_png_()
    assert abs(Image.open(io.BytesIO(shown)).width - 85 / 25.4 * 144) < 1


@pytest.mark.parametrize("name", ["IH1", "IH5", "IH21"])
def test_seeds_are_orbits_and_keep_their_distance(name: str) -> None:
    group = isohedral_class(name).group()
    seeds = symmetric_seeds(group, 0.3, tries=100)
    assert len(seeds) % group.order == 0
    assert len(seeds) > 10
    for g in group.cosets:
        moved = group.wrap(g(seeds))
        gaps = np.linalg.norm(moved[:, None] - seeds, axis=-1)
        assert (np.sort(gaps.min(axis=1))[: len(seeds) // 2] < 1e-9).all()


def test_flow_lines_follow_the_field() -> None:
    def turning(points: Array) -> Array:
        return np.stack([-points[..., 1], points[..., 0]], axis=-1)

    lines = flow_lines(turning, np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 2.0]]), 0.5)
    assert lines.shape == (2, 13, 2)  # the fixed point has none
    radii = np.linalg.norm(lines, axis=-1)
    assert np.ptp(radii, axis=1).max() < 1e-4
    assert lines[0, -1, 1] > 0 > lines[0, 0, 1]
