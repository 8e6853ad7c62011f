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
from refusals import refused


@pytest.mark.parametrize(
    ("corner", "size"),
    [
        *((corner, SIZE) for corner in CORNERS),
        *(("top left", (20, 10)), ("bottom right", (3074, 1537))),
    ],
)
def test_a_mask_lies_over_its_picture(tmp_path: Path, corner: str, size: tuple[int, int]) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(corner, size)), target)
    assert_emphasised(emphasis, target, corner)
    assert len(emphasis.notes) == (size != SIZE)
    assert emphasis.share == pytest.approx(0.25, abs=0.01)
    nearest = target.normal[np.argmax(emphasis.weight(target.normal))]
    assert ("left" in corner) == (nearest[0] < 0)
    assert ("top" in corner) == (nearest[1] > 0)
    middle = emphasis.weight(target.to_normal([[100.0, 70.0], [100.0, 30.0]]))
    assert sorted(middle) == pytest.approx([1, 2.5], abs=0.1)


@pytest.mark.parametrize("corner", ["top left", "bottom right"])
@pytest.mark.parametrize("y_down", [True, False])
def test_a_mask_lies_over_a_polygons_box(tmp_path: Path, corner: str, y_down: bool) -> None:
    target = polygon(tmp_path, y_down=y_down)
    emphasis = Emphasis.read(save(tmp_path, mask(corner, (160, 80))), target)
    up = {"top": "bottom", "bottom": "top"}
    end, side = corner.split()
    # CORNERS are named as seen with y down; a mask shows its top where the shape's top is.
    assert_emphasised(emphasis, target, corner if y_down else f"{up[end]} {side}")
    assert emphasis.box == pytest.approx((*target.normal.min(axis=0), *target.normal.max(axis=0)))


@pytest.mark.parametrize(
    ("page", "corner", "size"),
    [
        ('viewBox="0 0 200 100"', (0, 0), SIZE),
        ('viewBox="-1000 500 200 100"', (-1000, 500), (400, 200)),
        ("", (0, 0), (160, 80)),  # over the outline's box
    ],
)
def test_a_mask_lies_over_a_drawings_page(
    tmp_path: Path, page: str, corner: tuple[int, int], size: tuple[int, int]
) -> None:
    target = drawing(tmp_path, page, x=corner[0] + 20, y=corner[1] + 10)
    Path(target.source).unlink()  # it is not read again
    emphasis = Emphasis.read(save(tmp_path, mask(size=size)), target)
    at = target.to_normal(np.array(list(CORNERS.values())) + corner)
    assert emphasis.weight(at) == pytest.approx([4, 1, 1, 1], abs=0.03)


def test_averaged_masks_keep_their_place(tmp_path: Path) -> None:
    # 3002 pixels in threes leave a last column of 2.
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(size=(3002, 1501))), target)
    assert emphasis.mask.shape == (501, 1001)
    assert target.to_input(emphasis.box[2:]) == pytest.approx([200 * 3003 / 3002, 0])
    assert target.to_input(emphasis.box[:2]) == pytest.approx([0, 100 * 1503 / 1501])


@pytest.mark.parametrize(
    ("of", "size"),
    [
        *((picture, size) for size in ((100, 200), (200, 103), (204, 100), (1000, 2))),
        (lambda folder: polygon(folder, y_down=False), (64, 64)),
        (lambda folder: drawing(folder, 'viewBox="0 0 200 90.5"'), (64, 64)),
    ],
)
def test_another_aspect_is_refused(
    tmp_path: Path, of: Callable[[Path], Target], size: tuple[int, int]
) -> None:
    path = save(tmp_path, mask(size=size))
    with refused(path, f"{size[0]} x {size[1]}", kind=InputFileError):
        Emphasis.read(path, of(tmp_path))


def test_an_aspect_within_one_percent_is_taken(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask(size=(199, 100))), target)
    assert_emphasised(emphasis, target, "top left")


def test_weights_are_bilinear_between_pixel_centres() -> None:
    rows, columns = np.mgrid[:8, :10]
    emphasis = Emphasis((rows + columns) / 16.0, (-1.0, 2.0, 4.0, 6.0), strength=17.0)
    rng = np.random.default_rng(3)
    at = rng.uniform((-0.75, 2.25), (3.75, 5.75), (50, 4, 2))
    expected = 1 + (at[..., 0] + 0.75) / 0.5 + (5.75 - at[..., 1]) / 0.5
    assert np.allclose(emphasis.weight(at), expected, atol=1e-5)


def test_weights_fade_to_one_beyond_the_frame() -> None:
    emphasis = Emphasis(np.ones((4, 4)), (-1, -1, 1, 1), strength=5.0)
    beyond = np.linspace(0, 2 * FADE_WIDTH, 201)
    for ray in ([1, 0], [0, 1], [-1, 0], [0, -1]):
        weights = emphasis.weight(np.multiply.outer(1 + beyond, ray))
        assert weights[0] == pytest.approx(5)
        assert (weights[beyond > FADE_WIDTH] == 1).all()
        assert (np.diff(weights) <= 0).all()
        assert np.abs(np.diff(weights)).max() < 0.07


@given(st.integers(0, 2**32 - 1), st.floats(1.01, 100))
def test_weights_lie_between_one_and_the_strength(seed: int, strength: float) -> None:
    rng = np.random.default_rng(seed)
    low = rng.uniform(-3, 0, 2)
    frame = (*low, *(low + rng.uniform(0.01, 5, 2)))
    emphasis = Emphasis(rng.random(rng.integers(1, 9, 2)), frame, strength)
    weights = emphasis.weight(rng.uniform(-4, 6, (60, 2)))
    assert (weights >= 1).all()
    assert (weights <= strength * (1 + 1e-6)).all()


def test_an_edge_of_the_mask_is_drawn_out(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask("top left", (1400, 700))), target)
    x = np.linspace(-0.2, 0.2, 401)
    weights = emphasis.weight(np.stack([x, np.full_like(x, 0.2)], axis=1))
    # A normal distribution's slope: the step over sqrt(2 pi) standard deviations.
    steepest = np.abs(np.diff(weights)).max() / (x[1] - x[0])
    assert steepest == pytest.approx(3 / (np.sqrt(2 * np.pi) * 0.02), rel=0.05)


def test_a_soft_target_has_the_weights(tmp_path: Path) -> None:
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, mask("top right")), target)
    at = np.random.default_rng(0).uniform(-0.7, 0.7, (500, 2))
    sampled = SoftTarget(target, emphasis=emphasis).weight(torch.tensor(at))
    assert np.allclose(sampled.numpy(), emphasis.weight(at), atol=0.1)


def test_a_report_is_json_ready(tmp_path: Path) -> None:
    path = save(tmp_path, mask())
    emphasis = Emphasis.read(path, picture(tmp_path))
    report = json.loads(json.dumps(emphasis.report()))
    assert report == {"source": str(path), "strength": 4, "share": emphasis.share, "notes": []}


def test_a_shape_thinner_than_the_grid_is_still_met(tmp_path: Path) -> None:
    needle = Target.from_polygon([[0, 0], [1000, 999.9], [1000, 1000], [999.9, 1000]])
    emphasis = Emphasis.read(save(tmp_path, mask("bottom left", (90, 90))), needle)
    assert emphasis.share is not None
    assert 0.2 < emphasis.share < 0.8


MODES: dict[str, tuple[Callable[[], Image.Image], float]] = {
    "1": (lambda: mask().convert("1"), 4),
    "RGB": (lambda: mask().convert("RGB"), 4),
    "half-transparent": (lambda: painted((255, 255, 255, 90), (0, 0, 0, 90)), 4),
    "alpha, black on white": (lambda: painted((0, 0, 0, 255), (255, 255, 255, 0)), 4),
    "alpha of LA": (lambda: painted((0, 255), (255, 0), "LA"), 4),
    "graded": (lambda: mask(light=51), 1 + 3 * 0.2),
    "faint alpha": (lambda: painted((9, 9, 9, 26), (255, 255, 255, 0)), 1 + 3 * 26 / 255),
    "graded 16": (lambda: Image.fromarray(np.asarray(mask()).astype(np.uint16) * 100), 2.167),
}


@pytest.mark.parametrize("mode", MODES)
def test_every_mode_of_png(tmp_path: Path, mode: str) -> None:
    make, weight = MODES[mode]
    target = picture(tmp_path)
    emphasis = Emphasis.read(save(tmp_path, make()), target)
    assert_emphasised(emphasis, target, "top left", weight)
    assert any("alpha" in note for note in emphasis.notes) == ("alpha" in mode)


def test_a_mask_that_is_dark_or_looks_inverted_is_said(tmp_path: Path) -> None:
    dark = Emphasis.read(save(tmp_path, mask(light=51)), picture(tmp_path), strength=11)
    assert "weights go up to 3, not 11" in dark.notes[0]
    other = Emphasis.read(save(tmp_path, inverted(mask())), picture(tmp_path))
    assert "invert the mask" in other.notes[0]


BAD_MASKS: dict[str, tuple[Callable[[], Image.Image], str]] = {
    "nearly black": (lambda: mask(light=9), "all black"),
    "grey": (lambda: Image.new("RGB", SIZE, (99, 99, 99)), "uniform"),
    "nearly grey": (lambda: painted(209, 200, "L"), "uniform"),
    "nearly transparent": (lambda: painted((0, 0, 0, 5), (0, 0, 0, 0)), "wholly transparent"),
    "opaque black": (lambda: Image.new("RGBA", SIZE, (0, 0, 0, 255)), "all black"),
    "one alpha": (lambda: Image.new("RGBA", SIZE, (255, 255, 255, 128)), "uniform"),
    "beside the silhouette": (
        lambda: Image.fromarray(np.pad(np.full((100, 9), 255, np.uint8), ((0, 0), (0, 191)))),
        "does not touch",
    ),
}


@pytest.mark.parametrize("case", BAD_MASKS)
def test_masks_that_emphasise_nothing(tmp_path: Path, case: str) -> None:
    make, about = BAD_MASKS[case]
    path = save(tmp_path, make())
    with refused(path, about, kind=InputFileError):
        Emphasis.read(path, picture(tmp_path))


@pytest.mark.parametrize("strength", [1, -4, 100.1, float("nan")])
def test_strength_out_of_range(tmp_path: Path, strength: float) -> None:
    path, target = save(tmp_path, mask()), picture(tmp_path)
    with refused("strength", 100):
        Emphasis.read(path, target, strength=strength)
    weights = corner_weights(Emphasis.read(path, target, strength=100), target)
    assert weights["top left"] == pytest.approx(100, rel=0.01)


@pytest.mark.parametrize(
    ("array", "box"),
    [
        *((np.zeros(shape), (0, 0, 1, 1)) for shape in (4, (0, 3))),
        *((np.full((2, 2), level), (0, 0, 1, 1)) for level in (1.5, np.nan)),
        *((np.eye(2), (0, 0, width, 1)) for width in (0, np.inf)),
    ],
)
def test_arrays_that_are_no_mask(array: np.ndarray, box: Any) -> None:
    with refused("mask"):
        Emphasis(array, box)
    with refused("points"):
        Emphasis(np.eye(2), (-1, -1, 1, 1)).weight([1.0, 2.0, 3.0])
