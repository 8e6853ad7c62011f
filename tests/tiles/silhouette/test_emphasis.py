"""Emphasis: which way round, sizes, weights, masks as files, and what is refused."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from mask_files import (
    CORNERS,
    SIZE,
    assert_emphasised,
    corner_weights,
    drawing,
    inverted,
    mask,
    painted,
    picture,
    polygon,
    save,
)
from orbiflow.errors import InputFileError
from orbiflow.tiles import Emphasis, SoftTarget, Target
from orbiflow.tiles.silhouette.emphasis import FADE_WIDTH
from png_files import promise
from refusals import refused

# Which way round


@pytest.mark.parametrize("corner", CORNERS)
def test_image(tmp_path: Path, corner: str) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(corner)), target)
    assert_emphasised(emphasis, target, corner)
    assert emphasis.notes == ()
    assert emphasis.share == pytest.approx(0.25, abs=0.01)
    nearest = target.normal[np.argmax(emphasis.weight(target.normal))]
    assert ("left" in corner) == (nearest[0] < 0)
    assert ("top" in corner) == (nearest[1] > 0)


@pytest.mark.parametrize("corner", CORNERS)
@pytest.mark.parametrize("y_down", [True, False])
def test_polygon(tmp_path: Path, corner: str, y_down: bool) -> None:
    target = polygon(tmp_path, y_down=y_down)
    emphasis = Emphasis.read(save(tmp_path, mask(corner, (160, 80))), target)
    up = {"top": "bottom", "bottom": "top"}
    end, side = corner.split()
    # CORNERS are named as seen with y down; a mask shows its top where the shape's top is.
    assert_emphasised(emphasis, target, corner if y_down else f"{up[end]} {side}")
    assert emphasis.notes == (
        "laid the mask (160 x 80 pixels) over the silhouette's bounding box (160 x 80)",
    )
    assert emphasis.box == pytest.approx((*target.normal.min(axis=0), *target.normal.max(axis=0)))


@pytest.mark.parametrize("corner", CORNERS)
def test_drawing(tmp_path: Path, corner: str) -> None:
    target = drawing(tmp_path, 'viewBox="0 0 200 100"')
    emphasis = Emphasis.read(save(tmp_path, mask(corner)), target)
    assert_emphasised(emphasis, target, corner)
    assert emphasis.notes == ()


def test_page_of_a_drawing_may_begin_anywhere(tmp_path: Path) -> None:
    target = drawing(tmp_path, 'viewBox="-1000 500 200 100"', x=-980, y=510)
    emphasis = Emphasis.read(save(tmp_path, mask(size=(400, 200))), target)
    at = target.to_normal([(x - 1000, y + 500) for x, y in CORNERS.values()])
    assert emphasis.weight(at) == pytest.approx([4, 1, 1, 1], abs=0.03)
    assert target.to_input(emphasis.box[:2]) == pytest.approx([-1000, 600])
    assert emphasis.notes == (
        "laid the mask (400 x 200 pixels) over the drawing's page (200 x 100)",
    )


def test_drawing_without_a_page_is_covered_by_its_outline(tmp_path: Path) -> None:
    target = drawing(tmp_path, "")
    emphasis = Emphasis.read(save(tmp_path, mask(size=(160, 80))), target)
    assert_emphasised(emphasis, target, "top left")
    assert "the silhouette's bounding box" in emphasis.notes[0]


def test_the_drawing_is_not_read_again(tmp_path: Path) -> None:
    target = drawing(tmp_path, 'viewBox="0 0 200 100"')
    Path(target.source).unlink()
    assert_emphasised(Emphasis.read(save(tmp_path, mask()), target), target, "top left")


# Sizes


@pytest.mark.parametrize("scale", [0.1, 0.5, 3, 15, 15.37])
def test_scaled_copies(tmp_path: Path, scale: float) -> None:
    target = picture(tmp_path)
    width, height = (round(side * scale) for side in SIZE)
    emphasis = Emphasis.read(save(tmp_path, mask("bottom right", (width, height))), target)
    assert_emphasised(emphasis, target, "bottom right")
    assert emphasis.notes == (
        f"laid the mask ({width} x {height} pixels) over the silhouette's picture (200 x 100)",
    )
    middle = emphasis.weight(target.to_normal([[100.0, 70.0], [150.0, 50.0]]))
    assert middle == pytest.approx([2.5, 2.5], abs=0.1)


def test_averaged_masks_keep_their_place(tmp_path: Path) -> None:
    # 3002 pixels in threes leave a last column of 2.
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(size=(3002, 1501))), target)
    assert emphasis.mask.shape == (501, 1001)
    assert emphasis.weight(target.to_normal([100.0, 20.0])) == pytest.approx(2.5, abs=0.02)
    assert target.to_input(emphasis.box[2:]) == pytest.approx([200 * 3003 / 3002, 0])
    assert target.to_input(emphasis.box[:2]) == pytest.approx([0, 100 * 1503 / 1501])


@pytest.mark.parametrize("size", [(100, 200), (200, 200), (200, 103), (204, 100), (1000, 2)])
def test_another_aspect(tmp_path: Path, size: tuple[int, int]) -> None:
    path = save(tmp_path, mask(size=size))
    said = rf"mask is {size[0]} x {size[1]} and the silhouette's picture is 200 x 100; .* copy of"
    with pytest.raises(InputFileError, match=said) as caught:
        Emphasis.read(path, picture(tmp_path))
    assert str(caught.value).startswith(f"{path}: ")


def test_aspect_within_one_percent(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(size=(199, 100))), target)
    assert len(emphasis.notes) == 1
    assert_emphasised(emphasis, target, "top left")


@pytest.mark.parametrize(
    ("make", "covered"),
    [
        (lambda folder: polygon(folder, y_down=False), r"silhouette's bounding box is 160 x 80"),
        (
            lambda folder: drawing(folder, 'viewBox="0 0 200 90.5"'),
            r"drawing's page is 200 x 90\.5",
        ),
    ],
)
def test_another_aspect_without_a_picture(
    tmp_path: Path, make: Callable[[Path], Target], covered: str
) -> None:
    with pytest.raises(InputFileError, match=rf"64 x 64 and the {covered}"):
        Emphasis.read(save(tmp_path, mask(size=(64, 64))), make(tmp_path))


# Weights


def test_weights_are_bilinear_between_pixel_centres() -> None:
    rows, columns = np.mgrid[:8, :10]
    emphasis = Emphasis((rows + columns) / 16.0, (-1.0, 2.0, 4.0, 6.0), strength=17.0)
    rng = np.random.default_rng(3)
    at = rng.uniform((-0.75, 2.25), (3.75, 5.75), (50, 4, 2))
    expected = 1 + (at[..., 0] + 0.75) / 0.5 + (5.75 - at[..., 1]) / 0.5
    assert np.allclose(emphasis.weight(at), expected, atol=1e-5)
    centre = emphasis.weight([-1 + 0.5 * 3.5, 6 - 0.5 * 2.5])
    assert centre.shape == ()
    assert centre == pytest.approx(1 + 2 + 3)


def test_weights_fade_to_one_beyond_the_frame() -> None:
    emphasis = Emphasis(np.ones((4, 4)), (-1, -1, 1, 1), strength=5.0)
    beyond = np.linspace(0, 2 * FADE_WIDTH, 201)
    for ray in ([1, 0], [0, 1], [-1, 0], [0, -1]):
        weights = emphasis.weight(np.multiply.outer(1 + beyond, ray))
        assert weights[0] == pytest.approx(5)
        assert (weights[beyond > FADE_WIDTH] == 1).all()
        assert (np.diff(weights) <= 0).all()
        assert np.abs(np.diff(weights)).max() < 0.07
    assert emphasis.weight([1e9, -1e9]) == 1


def test_no_points_and_no_numbers() -> None:
    emphasis = Emphasis(np.eye(2), (-1, -1, 1, 1))
    assert emphasis.weight(np.zeros((0, 2))).shape == (0,)
    for points in ([1.0, 2.0, 3.0], 1.0, [[np.nan, 0.0]], [[np.inf, 0.0]]):
        with refused("points"):
            emphasis.weight(points)


@given(st.integers(0, 2**32 - 1), st.floats(1.01, 100))
def test_weights_lie_between_one_and_the_strength(seed: int, strength: float) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 0, 2)
    frame = (*low, *(low + rng.uniform(0.01, 5, 2)))
    emphasis = Emphasis(rng.random(rng.integers(1, 9, 2)), frame, strength)
    at = rng.uniform(-4, 6, (60, 2))
    weights = emphasis.weight(at)
    assert (weights >= 1).all()
    assert (weights <= strength * (1 + 1e-6)).all()
    near = emphasis.weight(at + rng.uniform(-1e-7, 1e-7, at.shape))
    assert np.allclose(near, weights, atol=1e-2 * strength)


def test_an_edge_of_the_mask_is_drawn_out(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask("top left", (1400, 700))), target)
    x = np.linspace(-0.2, 0.2, 401)
    weights = emphasis.weight(np.stack([x, np.full_like(x, 0.2)], axis=1))
    assert weights[0] == pytest.approx(4)
    assert weights[-1] == pytest.approx(1)
    # A normal distribution's slope: the step over sqrt(2 pi) standard deviations.
    steepest = np.abs(np.diff(weights)).max() / (x[1] - x[0])
    assert steepest == pytest.approx(3 / (np.sqrt(2 * np.pi) * 0.02), rel=0.05)


def test_a_soft_target_has_the_weights(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask("top right")), target)
    at = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    sampled = SoftTarget(target, emphasis=emphasis).weight(torch.tensor(at))
    assert np.allclose(sampled.numpy(), emphasis.weight(at), atol=0.1)


def test_mask_is_read_only_and_report_is_json_ready(tmp_path: Path) -> None:
    path = save(tmp_path, mask(size=(100, 50)))
    emphasis = Emphasis.read(path, picture(tmp_path))
    with refused("read-only", kind=ValueError):
        emphasis.mask[0] = 0
    report = json.loads(json.dumps(emphasis.report()))
    assert report == {
        "source": str(path),
        "strength": 4.0,
        "share": pytest.approx(0.25, abs=0.01),
        "notes": ["laid the mask (100 x 50 pixels) over the silhouette's picture (200 x 100)"],
    }


def test_a_shape_thinner_than_the_grid_is_still_met(tmp_path: Path) -> None:
    needle = Target.from_polygon([[0, 0], [1000, 999.9], [1000, 1000], [999.9, 1000]])
    emphasis = Emphasis.read(save(tmp_path, mask("bottom left", (90, 90))), needle)
    assert emphasis.share is not None
    assert 0.2 < emphasis.share < 0.8


# Levels


MODES: dict[str, tuple[Callable[[], Image.Image], float]] = {
    "1": (lambda: mask().convert("1"), 4),
    "L": (mask, 4),
    "RGB": (lambda: mask().convert("RGB"), 4),
    "P": (lambda: mask().convert("RGB").quantize(4), 4),
    "I;16": (lambda: Image.fromarray(np.asarray(mask()).astype(np.uint16) * 257), 4),
    "opaque RGBA": (lambda: painted((255, 255, 255, 255), (0, 0, 0, 255)), 4),
    "half-transparent": (lambda: painted((255, 255, 255, 90), (0, 0, 0, 90)), 4),
    "alpha, black on white": (lambda: painted((0, 0, 0, 255), (255, 255, 255, 0)), 4),
    "alpha, white on black": (lambda: painted((255, 255, 255, 255), (0, 0, 0, 0)), 4),
    "alpha of LA": (lambda: painted((0, 255), (255, 0), "LA"), 4),
    "graded": (lambda: mask(light=51), 1 + 3 * 0.2),
    "graded alpha": (lambda: painted((9, 9, 9, 102), (9, 9, 9, 0)), 1 + 3 * 0.4),
    "faint alpha": (lambda: painted((9, 9, 9, 26), (255, 255, 255, 0)), 1 + 3 * 26 / 255),
    "graded 16": (lambda: Image.fromarray(np.asarray(mask()).astype(np.uint16) * 100), 2.167),
}


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_of_png(tmp_path: Path, mode: str) -> None:
    make, weight = MODES[mode]
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, make()), target)
    assert_emphasised(emphasis, target, "top left", weight)
    by_alpha = "took the mask's alpha channel: opaque is emphasised, whatever its colour"
    assert (by_alpha in emphasis.notes) == ("alpha" in mode)


def test_what_falls_short_of_white_is_said(tmp_path: Path) -> None:
    emphasis = Emphasis.read(save(tmp_path, mask(light=51)), picture(tmp_path), strength=11)
    assert emphasis.notes == ("the mask reaches 20% of full emphasis: weights go up to 3, not 11",)


def test_a_mask_that_looks_inverted_is_said(tmp_path: Path) -> None:
    emphasis = Emphasis.read(save(tmp_path, inverted(mask())), picture(tmp_path))
    assert emphasis.notes[0].startswith("the mask emphasises 75")
    assert emphasis.notes[0].endswith("if the other part was meant, invert the mask")


# Refusals


BAD_MASKS: dict[str, tuple[Callable[[], Image.Image], str]] = {
    "black": (lambda: Image.new("L", SIZE, 0), "all black .* paint what must survive white"),
    "white": (lambda: Image.new("L", SIZE, 255), r"uniform, .* 1\.00 to 1\.00 .* paint what"),
    "grey": (lambda: Image.new("RGB", SIZE, (99, 99, 99)), r"uniform, .* 0\.39"),
    "nearly black": (lambda: mask(light=9), "all black"),
    "nearly grey": (lambda: painted(209, 200, "L"), "uniform"),
    "transparent": (lambda: Image.new("RGBA", SIZE, (255, 255, 255, 0)), "wholly transparent"),
    "nearly so": (lambda: painted((0, 0, 0, 5), (0, 0, 0, 0)), "wholly transparent"),
    "opaque black": (lambda: Image.new("RGBA", SIZE, (0, 0, 0, 255)), "all black"),
    "one alpha, white": (lambda: Image.new("RGBA", SIZE, (255, 255, 255, 128)), "uniform"),
    "one pixel": (lambda: Image.new("L", (1, 1), 255), "1 x 1 pixels"),
    "beside the silhouette": (
        lambda: Image.fromarray(np.pad(np.full((100, 9), 255, np.uint8), ((0, 0), (0, 191)))),
        "does not touch the silhouette",
    ),
}


@pytest.mark.parametrize("case", BAD_MASKS)
def test_masks_that_emphasise_nothing(tmp_path: Path, case: str) -> None:
    make, message = BAD_MASKS[case]
    path = save(tmp_path, make())
    with pytest.raises(InputFileError, match=message) as caught:
        Emphasis.read(path, picture(tmp_path))
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"this is no picture at all\n" * 30, "or it is none; give a PNG"),
        (b"<svg xmlns='http://www.w3.org/2000/svg'/>", "or it is none"),
        (promise(200, 100), "damaged or cut short"),
    ],
)
def test_files_that_are_no_mask(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "mask.png"
    path.write_bytes(content)
    with pytest.raises(InputFileError, match=message):
        Emphasis.read(path, picture(tmp_path))


@pytest.mark.parametrize("strength", [1, 0, -4, 100.1, float("inf"), float("nan")])
def test_strength_out_of_range(tmp_path: Path, strength: float) -> None:
    path, target = save(tmp_path, mask()), picture(tmp_path)
    with refused("strength", 100):
        Emphasis.read(path, target, strength=strength)


@pytest.mark.parametrize("strength", [1.5, 100])
def test_strength(tmp_path: Path, strength: float) -> None:
    path, target = save(tmp_path, mask()), picture(tmp_path)
    weights = corner_weights(Emphasis.read(path, target, strength=strength), target)
    assert weights["top left"] == pytest.approx(strength, rel=0.01)


@pytest.mark.parametrize(
    ("array", "box"),
    [
        (np.zeros(4), (0, 0, 1, 1)),
        (np.zeros((0, 3)), (0, 0, 1, 1)),
        (np.full((2, 2), 1.5), (0, 0, 1, 1)),
        (np.full((2, 2), np.nan), (0, 0, 1, 1)),
        (np.eye(2), (0, 0, 0, 1)),
        (np.eye(2), (0, 0, np.inf, 1)),
    ],
)
def test_arrays_that_are_no_mask(array: np.ndarray, box: Any) -> None:
    with refused("mask"):
        Emphasis(array, box)
