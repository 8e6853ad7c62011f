"""What is said of a reading before a search, and silhouettes smoothed alike from any kind of file."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError
from orbiflow.tiles import Target, hausdorff, read_outline
from orbiflow.tiles.silhouette import ReadingSettings, doubts
from refusals import refused


def wavy(count: int = 400, ripple: float = 4.0) -> Array:
    """A blob, 300 units wide, with a fine ripple and a thorn."""
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    radius = 120 + 25 * np.cos(3 * angle) + ripple * np.cos(40 * angle)
    radius[count // 3] += 40
    return np.stack([200 + radius * np.cos(angle), 200 + radius * np.sin(angle)], axis=1)


def as_png(path: Path, *rings: Array) -> Path:
    image = Image.new("L", (1600, 1600), 255)
    for ring in rings:
        ImageDraw.Draw(image).polygon([(4 * x, 4 * y) for x, y in ring.tolist()], fill=0)
    image.reduce(4).save(path)
    return path


def as_svg(path: Path, *rings: Array) -> Path:
    paths = (" ".join(f"{x},{y}" for x, y in ring.tolist()) for ring in rings)
    body = "".join(f'<polygon points="{points}"/>' for points in paths)
    path.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 400">{body}</svg>')
    return path


def as_json(path: Path, ring: Array) -> Path:
    path.write_text(json.dumps({"polygon": ring.tolist(), "y_down": True}))
    return path


def test_smoothing_does_the_same_to_pictures_drawings_and_polygons(tmp_path: Path) -> None:
    ring, reading = wavy(), ReadingSettings(smooth=0.06)
    files = [as_png(tmp_path / "a.png", ring), as_svg(tmp_path / "a.svg", ring)]
    files.append(as_json(tmp_path / "a.json", ring))
    png, svg, polygon = (reading.read(file).outline for file in files)
    assert hausdorff(png, polygon) < 1
    assert hausdorff(svg, polygon) < 1
    assert hausdorff(polygon, ring) > 20  # the thorn has gone
    rough, smooth = shapely.Polygon(ring), shapely.Polygon(polygon)
    assert smooth.length < 0.8 * rough.length
    assert abs(smooth.area / rough.area - 1) < 0.05


@settings(max_examples=12)
@given(st.floats(0.005, 0.1), st.floats(0, 8))
def test_smoothed_outlines_are_simple_and_smooth_to_their_width(share, ripple) -> None:
    target = Target.from_polygon(wavy(120, ripple))
    shape = shapely.Polygon(target.smoothed(share).outline)
    assert shape.is_valid
    width = share * float(np.ptp(target.outline, axis=0).max())
    opened = shape.buffer(-0.48 * width).buffer(0.48 * width)
    assert shape.difference(opened.buffer(0.05 * width)).area < 1e-6 * shape.area


def test_smoothing_by_nothing_changes_nothing() -> None:
    target = Target.from_polygon(wavy())
    assert target.smoothed(0.0) is target


BAR = [[0, 40], [0, 0], [40, 0], [40, 19], [90, 19], [90, 21], [40, 21], [40, 40]]


@pytest.mark.parametrize(
    ("ring", "share", "limbs"),
    [
        (BAR, 0.03, "and 1 limb went"),
        (BAR, 0.1, "and 1 limb went"),
        (BAR, 0.01, "of the area went"),
        ([[0, 0], [9, 0], [9, 8], [0, 8]], 0.05, "of the area went"),
    ],
)
def test_smoothing_says_what_went(ring: list[list[float]], share: float, limbs: str) -> None:
    note = Target.from_polygon(ring).smoothed(share).notes[-1]
    assert note.startswith(f"rounded off what is narrower than {share:.1%} of the length")
    assert note.endswith(limbs)


def test_smoothing_that_leaves_nothing() -> None:
    with refused("smooth", "0.1"):
        Target.from_polygon([[0, 0], [9, 0], [9, 0.2], [0, 0.2]]).smoothed(0.1)


def test_a_gap_is_closed_and_its_part_kept(tmp_path: Path) -> None:
    body, head = shapely.box(50, 150, 250, 300), shapely.box(254, 150, 350, 250)
    rings = [np.array(part.exterior.coords) for part in (body, head)]
    for file in (as_png(tmp_path / "a.png", *rings), as_svg(tmp_path / "a.svg", *rings)):
        apart = ReadingSettings().read(file)
        (said,) = doubts(apart)
        assert "24." in said
        assert "a part apart from the rest" in said
        assert "larger smooth" in said
        assert ("another threshold" in said) == (file.suffix == ".png")
        joined = ReadingSettings(smooth=0.03).read(file)
        assert not doubts(joined)
        assert joined.outline.max(axis=0)[0] == pytest.approx(350, abs=1)


def test_a_hole_that_may_be_background_is_warned_of(tmp_path: Path) -> None:
    def read(hole: float) -> list[str]:
        image = Image.new("L", (400, 400), 255)
        pen = ImageDraw.Draw(image)
        pen.ellipse((50, 50, 350, 350), fill=0)
        pen.ellipse((200 - hole, 200 - hole, 200 + hole, 200 + hole), fill=255)
        image.save(tmp_path / "a.png")
        return [*doubts(ReadingSettings().read(tmp_path / "a.png"))]

    assert "large holes were filled" in read(60)[0]
    assert "another invert" in read(60)[0]
    assert not read(10)  # an eye
    assert not read(140)  # the line of a drawing


def drawn(tmp_path: Path, size: int, draw: str, *args: object, **options: object) -> list[str]:
    image = Image.new("L", (size * 4, size * 4), 255)
    getattr(ImageDraw.Draw(image), draw)(*args, **{"fill": 0, **options})
    image.reduce(4).save(tmp_path / "a.png")
    return [*doubts(ReadingSettings().read(tmp_path / "a.png"))]


def test_what_is_hopeless_is_said(tmp_path: Path) -> None:
    line = drawn(tmp_path, 200, "line", (80, 80, 720, 600), width=8)
    assert "is a line or thread" in line[0]
    assert "less than 3 pixels wide" in line[1]
    serif = drawn(tmp_path, 200, "rectangle", (80, 380, 720, 404))
    assert "is a line or thread" in serif[0]
    arc = drawn(tmp_path, 200, "arc", (80, 80, 720, 720), 0, 300, width=9)
    assert "is a line or thread" in arc[0]
    tiny = drawn(tmp_path, 40, "ellipse", (20, 20, 140, 100))
    assert "only 30 pixels long" in tiny[0]
    assert not drawn(tmp_path, 200, "ellipse", (80, 80, 720, 400))


def test_a_tight_crop_is_nothing_to_say(tmp_path: Path) -> None:
    image = Image.new("L", (1200, 800), 255)
    ImageDraw.Draw(image).ellipse((0, 0, 1199, 799), fill=0)
    image.reduce(4).save(tmp_path / "a.png")
    reading = read_outline(tmp_path / "a.png")
    assert len(reading.notes) == 1
    assert not doubts(Target.read(tmp_path / "a.png"))


@pytest.mark.parametrize(
    ("content", "name", "message"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(80), "cat.png", "the PNG image is damaged or cut short"),
        (b"\xff\xd8\xff" + bytes(80), "cat.jpg", "the JPEG image is damaged or cut short"),
        (bytes(200), "cat.png", "is damaged, or of a kind that is not read"),
        (b"%PDF-1.5", "cat.ai", "save it as SVG or PNG"),
        (b"%!PS-Adobe", "cat.eps", "save it as SVG or PNG"),
        (b"\xc5\xd0\xd3\xc6" + bytes(40), "cat.eps", "save it as SVG or PNG"),
        (b"RIFF\0\0\0\0CDRv" + bytes(40), "cat.cdr", "save it as SVG or PNG"),
        (b"8BPS" + bytes(40), "cat.psd", "save it as SVG or PNG"),
        (b"\0\0\0\x18ftypheic" + bytes(40), "cat.heic", "save it as SVG or PNG"),
        (b"%PDF-1.5", "cat.pdf", "save it as SVG or PNG"),
    ],
)
def test_files_of_other_programs(tmp_path: Path, content: bytes, name: str, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputFileError, match=message):
        read_outline(tmp_path / name)


EAR = '<path d="M240 150 q20 40 -5 60"/>'


@pytest.mark.parametrize("ear", ["", EAR])
@pytest.mark.parametrize(
    ("dashes", "is_whole"), [("12 6", True), ("820 20", True), ("12 8", True), ("700 300", False)]
)
def test_small_gaps_in_an_outline_are_closed(
    tmp_path: Path, dashes: str, is_whole: bool, ear: str
) -> None:
    body = f'<ellipse cx="200" cy="200" rx="160" ry="100" stroke-dasharray="{dashes}"/>{ear}'
    head = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 400"'
    path = tmp_path / "a.svg"
    path.write_text(f'{head} fill="none" stroke="black" stroke-width="4">{body}</svg>')
    target = Target.read(path)
    assert (target.area > 0.95 * np.pi * 160 * 100) == is_whole
    if is_whole:  # only its lines were seen, but the silhouette is what they enclose
        assert target.smoothed(0.03).area == pytest.approx(target.area, rel=0.02)
    assert (
        any("gaps of up to 3% of the drawing's size" in note for note in target.notes) == is_whole
    )
    assert not (is_whole and any("kept the largest" in note for note in target.notes))
    assert any("line or thread" in doubt for doubt in doubts(target)) != is_whole
