"""Lines around and behind a shape: frames are doubted, and grids left out."""

import io

import pytest
from PIL import Image, ImageDraw

from orbiflow.tiles import Target, doubts, iou

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
