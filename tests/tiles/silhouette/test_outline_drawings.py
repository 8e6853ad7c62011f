"""Drawings of an outline are read at the outer edge of their line; lines around a shape are doubted."""

from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image, ImageDraw, ImageOps

from orbiflow.tiles import FileContent, Reading, Target, doubts, iou, read_outline
from png_files import saved

TURNS = np.linspace(0, 2 * np.pi, 400, endpoint=False)
FINER = 8


def blob(size: int, waves: int = 3, depth: float = 0.25) -> Any:
    radius = 0.3 * size * (1 + depth * np.cos(waves * TURNS) + 0.1 * np.sin(7 * TURNS))
    return size / 2 + np.stack([radius * np.cos(TURNS), radius * np.sin(TURNS)], axis=1)


def drawn(ring: Any, size: int, width: float, ink: int = 0, ground: int = 255) -> Image.Image:
    """An anti-aliased closed line."""
    image = Image.new("L", (size * FINER, size * FINER), ground)
    ends = [tuple(xy) for xy in np.vstack([ring, ring[:2]]) * FINER]
    ImageDraw.Draw(image).line(ends, fill=ink, width=round(width * FINER), joint="curve")
    return image.reduce(FINER)


def read(image: Image.Image, kind: str = "PNG", **options: Any) -> Reading:
    return read_outline(FileContent(saved(image, kind), "a.png"), **options)


def offset(reading: Reading, ring: Any) -> float:
    """How far outside the ring the outline lies on average, in pixels."""
    shape = shapely.Polygon(ring)
    return (shapely.Polygon(reading.outline).area - shape.area) / shape.length


@given(
    st.integers(2, 5),
    st.floats(0.05, 0.3),
    st.floats(0.9, 7),
    st.sampled_from([(0, 255), (255, 0), (150, 235)]),
)
def test_the_outline_is_the_outer_edge_of_the_line(
    waves: int, depth: float, width: float, colours: tuple[int, int]
) -> None:
    ring = blob(220, waves, depth)
    reading = read(drawn(ring, 220, width, *colours))
    assert abs(offset(reading, ring) - width / 2) < 0.7
    assert shapely.Polygon(ring).within(shapely.Polygon(reading.outline).buffer(0.5))


RING = blob(400)
LINE = drawn(RING, 400, 2)


def transparent(line: Image.Image) -> Image.Image:
    image = Image.new("RGBA", line.size)
    image.putalpha(ImageOps.invert(line))
    return image


def with_details(line: Image.Image) -> Image.Image:
    image = line.copy()
    pen = ImageDraw.Draw(image)
    pen.ellipse((180, 180, 195, 195), fill=0)
    pen.line((200, 200, 230, 240), fill=0, width=2)
    pen.line((*RING[50], 200, 200), fill=0, width=3)  # it begins on the outline
    return image


KINDS: dict[str, tuple[Image.Image, str]] = {
    "JPEG": (LINE, "JPEG"),
    "colour": (ImageOps.colorize(LINE, "red", "ivory"), "PNG"),
    "transparent": (transparent(LINE), "PNG"),
    "two levels": (LINE.convert("1", dither=Image.Dither.NONE), "PNG"),
    "details inside": (with_details(LINE), "PNG"),
    "16 bits": (Image.fromarray(np.asarray(LINE).astype(np.uint16) * 257), "PNG"),
}


@pytest.mark.parametrize("case", KINDS)
def test_outlines_in_pictures_of_all_kinds(case: str) -> None:
    reading = read(*KINDS[case])
    assert abs(offset(reading, RING) - 1) < 0.7


def test_a_faint_thin_line_in_a_large_picture_holds_together() -> None:
    ring = blob(2000)
    image = Image.new("L", (4000, 4000), 255)
    ImageDraw.Draw(image).line(
        [tuple(xy) for xy in np.vstack([ring, ring[:2]]) * 2], fill=0, width=2
    )
    reading = read(image.reduce(2))  # a pixel wide, and then averaged
    assert iou(reading.outline, ring) > 0.99


def test_limbs_that_are_single_lines_are_kept() -> None:
    image = LINE.copy()
    ImageDraw.Draw(image).line((*RING[0], 395, 200), fill=0, width=3)
    assert read(image).outline[:, 0].max() > 390


def test_another_drawing_beside_it_is_said() -> None:
    image = LINE.copy()
    ImageDraw.Draw(image).ellipse((5, 5, 45, 45), fill=0)
    reading = read(image)
    assert "kept the largest of 2 components" in " ".join(reading.notes)
    assert abs(offset(reading, RING) - 1) < 0.2


@pytest.mark.parametrize("hole", [0, 30, 60])
def test_rings_and_filled_shapes_keep_their_outer_edge(hole: int) -> None:
    image = Image.new("L", (220, 220), 255)
    pen = ImageDraw.Draw(image)
    pen.ellipse((20, 20, 199, 199), fill=0)
    pen.ellipse((110 - hole, 110 - hole, 110 + hole, 110 + hole), fill=255 if hole else 0)
    reading = read(image)
    assert np.hypot(*(reading.outline - 110).T).max() == pytest.approx(90, abs=0.7)


SHAPE = [(30, 75), (30, 25), (70, 20), (72, 35), (45, 38), (45, 50), (62, 53), (60, 62), (42, 80)]
PATH = "M" + " L".join(f"{x},{y}" for x, y in SHAPE) + "Z"
SPINES = ["M10 10V90", "M90 10V90", "M10 10H90", "M10 90H90"]
FILL = f'<path d="{PATH}" fill="#27b"/>'
THIN = 'stroke-width="0.5" fill="none"'


def lines(paths: list[str], colour: str = "#000") -> str:
    return "".join(f'<path d="{path}" stroke="{colour}" {THIN}/>' for path in paths)


def drawing(*parts: str) -> Target:
    start = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
    return Target.from_bytes(f"{start}{''.join(parts)}</svg>".encode(), "a.svg")


def test_a_frame_is_the_shape_and_doubted() -> None:
    for inside in ("", '<circle cx="50" cy="50" r="3"/>', FILL):
        target = drawing(lines(SPINES), inside)
        assert target.area > 6000
        assert ["frame" in doubt for doubt in doubts(target)] == [True] * (inside == FILL)


@pytest.mark.parametrize("inside", [True, False])
def test_a_shape_in_a_round_frame_is_doubted(inside: bool) -> None:
    ring = '<circle cx="50" cy="50" r="48" fill="none" stroke="#000"/>'
    eye = '<circle cx="40" cy="50" r="4"/>'
    found = doubts(drawing(ring, FILL if inside else eye))
    assert [text for text in found if "inside the hole" in text] == found
    assert len(found) == inside
