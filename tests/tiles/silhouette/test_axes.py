"""Charts: the shape inside axes or a frame is taken, and grids behind it are left out."""

import io

import numpy as np
import pytest
from PIL import Image, ImageDraw

from orbiflow.tiles import Target, doubts, iou

SHAPE = [(30, 75), (30, 25), (70, 20), (72, 35), (45, 38), (45, 50), (62, 53), (60, 62), (42, 80)]
PATH = "M" + " L".join(f"{x},{y}" for x, y in SHAPE) + "Z"
SPINES = ["M10 10V90", "M90 10V90", "M10 10H90", "M10 90H90"]
OUTWARD = ["M30 90v3", "M60 90v3", "M10 30h-3", "M10 60h-3"]
INWARD = ["M30 90v-3", "M60 90v-3", "M10 30h3", "M10 60h3"]
GRID = ["M30 10V90", "M60 10V90", "M10 30H90", "M10 60H90"]
LABELS = '<rect x="28" y="95" width="4" height="3"/><rect x="2" y="28" width="4" height="3"/>'
FILL, LINE = f'<path d="{PATH}" fill="#27b"/>', f'<path d="{PATH}" fill="none" stroke="#27b"/>'
WHITE = '<path d="M0 0H100V100H0Z" fill="#fff"/><path d="M10 10H90V90H10Z" fill="#fff"/>'
THIN = 'stroke-width="0.5" fill="none"'


def lines(paths: list[str], colour: str = "#000") -> str:
    return "".join(f'<path d="{path}" stroke="{colour}" {THIN}/>' for path in paths)


def drawing(*parts: str) -> Target:
    start = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
    return Target.from_bytes(f"{start}{''.join(parts)}</svg>".encode(), "a.svg")


@pytest.mark.parametrize("marks", [[], OUTWARD, INWARD], ids=["none", "outward", "inward"])
@pytest.mark.parametrize("grid", [[], GRID], ids=["", "grid"])
@pytest.mark.parametrize("shape", [FILL, LINE], ids=["fill", "line"])
def test_the_shape_in_the_axes_of_a_drawing(marks: list[str], grid: list[str], shape: str) -> None:
    target = drawing(WHITE, shape, lines(grid, "#bbb"), lines([*marks, *SPINES]), LABELS)
    assert iou(target.outline, SHAPE) > 0.9
    assert any("left out the frame around the drawing" in note for note in target.notes)
    assert not doubts(target)


def test_a_frame_alone_or_around_a_speck_is_the_shape() -> None:
    for inside in ("", '<circle cx="50" cy="50" r="3"/>'):
        target = drawing(lines(SPINES), inside)
        assert target.area > 6000
        assert not any("frame" in note for note in target.notes)


@pytest.mark.parametrize("line", ["M0 40H100M0 60H100", "M50 0V100", "M0 30H100"])
def test_lines_of_another_colour_behind_a_shape(line: str) -> None:
    target = drawing(lines([line], "#ddd"), FILL)
    assert iou(target.outline, SHAPE) > 0.99
    assert "of another colour" in target.notes[0]


@pytest.mark.parametrize(
    ("line", "colour"),
    [("M0 40H100", "#27b"), ("M35 40H60", "#ddd"), ("M45 45H100", "#ddd"), ("M0 90H100", "#ddd")],
)
def test_other_lines_are_kept_and_nothing_is_said(line: str, colour: str) -> None:
    target = drawing(lines([line], colour), FILL)
    assert not any("of another colour" in note for note in target.notes)


def chart(outline: str, width: int, marks: int, *, frame: bool = True) -> Target:
    """Of a filled shape or its line, in axes with marks so long, outwards or inwards."""
    image = Image.new("L", (500, 400), 255)
    draw = ImageDraw.Draw(image)
    if frame:
        draw.rectangle((60, 40, 459, 339), outline=0, width=width)
    for x in (150, 300):
        draw.line((x, 339, x, 339 + marks), fill=0, width=width)
    for y in (100, 200):
        draw.line((60, y, 60 - marks, y), fill=0, width=width)
        draw.text((20, y), "20", fill=0)
    points = [(4 * x + 60, 3 * y + 40) for x, y in SHAPE]
    if outline == "fill":
        draw.polygon(points, fill=60)
    else:
        draw.line([*points, points[0], points[1]], fill=60, width=3)
    stream = io.BytesIO()
    image.save(stream, "PNG")
    return Target.from_bytes(stream.getvalue(), "a.png")


@pytest.mark.parametrize("marks", [0, 5, -5])
@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.parametrize("outline", ["fill", "line"])
def test_the_shape_in_the_axes_of_a_picture(outline: str, width: int, marks: int) -> None:
    target = chart(outline, width, marks)
    points = np.array(SHAPE) * (4, 3) + (60, 40)
    assert iou(target.outline, points) > 0.95
    assert any("left out the frame around the drawing" in note for note in target.notes)
    assert not doubts(target)


@pytest.mark.parametrize("inside", [True, False])
def test_a_shape_in_a_round_frame_is_doubted(inside: bool) -> None:
    ring = '<circle cx="50" cy="50" r="48" fill="none" stroke="#000"/>'
    eye = '<circle cx="40" cy="50" r="4"/>'
    found = doubts(drawing(ring, FILL if inside else eye))
    assert [text for text in found if "inside the hole" in text] == found
    assert len(found) == inside


@pytest.mark.parametrize("inside", [True, False])
def test_a_shape_in_a_round_frame_of_a_picture_is_doubted(inside: bool) -> None:
    image = Image.new("L", (300, 300), 255)
    draw = ImageDraw.Draw(image)
    draw.ellipse((10, 10, 289, 289), outline=0, width=3)
    points = [(3 * x, 3 * y) for x, y in SHAPE]
    if inside:
        draw.polygon(points, fill=0)
    else:
        draw.ellipse((100, 120, 120, 140), fill=0)
    stream = io.BytesIO()
    image.save(stream, "PNG")
    found = doubts(Target.from_bytes(stream.getvalue(), "a.png"))
    assert len(found) == inside
