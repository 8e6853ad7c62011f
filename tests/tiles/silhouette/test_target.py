"""The normal form of a target and its affine frame."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.errors import OrbiflowError
from orbiflow.tiles import Target, centroid, iou, signed_area
from refusals import refused


@st.composite
def star_shapes(draw: st.DrawFn) -> np.ndarray:
    """Star-shaped polygons (N, 2) of any place, size and sense."""
    n = draw(st.integers(3, 24))
    radii = np.array(draw(st.lists(st.floats(0.3, 1.0), min_size=n, max_size=n)))
    angle = 2 * np.pi * (np.arange(n) + 0.5) / n
    size = draw(st.floats(0.01, 1e4))
    place = [draw(st.floats(-100, 100)) for _ in range(2)]
    points = size * (radii[:, None] * np.stack([np.cos(angle), np.sin(angle)], 1) + place)
    return points[::-1] if draw(st.booleans()) else points


@given(star_shapes(), st.booleans())
def test_normal_form(points: np.ndarray, y_down: bool) -> None:
    target = Target.from_polygon(points, y_down=y_down)
    assert signed_area(target.normal) == pytest.approx(1, rel=1e-9)
    assert np.allclose(centroid(target.normal), 0, atol=1e-9)
    assert np.allclose(target.to_input(target.normal), target.outline, rtol=1e-12)
    rebuilt = target.normal @ target.frame.linear.T + target.frame.offset
    assert np.allclose(rebuilt, target.outline, rtol=1e-12)
    assert set(map(tuple, target.outline)) == set(map(tuple, points))


@given(star_shapes(), st.booleans(), st.lists(st.floats(-10, 10), min_size=2, max_size=2))
def test_frames_invert_each_other(points: np.ndarray, y_down: bool, at: list[float]) -> None:
    target = Target.from_polygon(points, y_down=y_down)
    scale = np.abs(target.outline).max() / np.sqrt(target.area) + 10
    assert np.allclose(target.to_normal(target.to_input(at)), at, atol=1e-12 * scale)


def test_y_down_flips_the_picture() -> None:
    # The long arm of this L points to larger y.
    points = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 5], [0, 5]]
    up, down = Target.from_polygon(points), Target.from_polygon(points, y_down=True)
    assert up.normal[:, 1].max() > -up.normal[:, 1].min()
    assert down.normal[:, 1].max() < -down.normal[:, 1].min()
    assert np.allclose(np.linalg.det(down.frame.linear), -down.area)


def test_frames_keep_leading_axes() -> None:
    target = Target.from_polygon([[0, 0], [3, 0], [0, 3]])
    assert target.to_input(np.zeros((4, 5, 2))).shape == (4, 5, 2)
    assert target.to_normal([1, 1]) == pytest.approx([0, 0])


def test_arrays_are_read_only() -> None:
    target = Target.from_polygon([[0, 0], [3, 0], [0, 3]])
    for array in (target.outline, target.normal, target.frame.linear, target.frame.offset):
        with refused("read-only", kind=ValueError):
            array[0] = 0


def test_report_is_json_ready(tmp_path: Path) -> None:
    file = tmp_path / "square.json"
    file.write_text('{"polygon": [[0, 0], [0, 2], [0, 2], [2, 2], [2, 0], [0, 0]]}')
    report = Target.read(file).report()
    assert json.loads(json.dumps(report)) == {
        "source": str(file),
        "kind": "json",
        "size": None,
        "vertices": 4,
        "area": 4.0,
        "y_down": False,
        "notes": [
            "dropped 1 repeated vertex",
            'took y to point up; if it points down, write {"outline": [...], "y_down": true}',
        ],
    }


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([[0, 0], [1, 0]], "at least 3 distinct vertices"),
        ([[0, 0], [1, 0], [2, 0]], "all lie on one line"),
        ([[0, 0], [1, 0], [0, float("nan")]], "vertex 2 .* finite"),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], r"crosses or touches itself near \(1, 1\)"),
        ([[0, 0], [1, 0], [1e13, 1]], "vertex 2 .* rescale"),
        ([[1e9, 0], [1e9 + 0.01, 0], [1e9, 0.01]], "no size"),
        ([[0, 0], [3, 0], [2, 1e-300], [-1, 10]], "crosses or touches"),
        ([["a", 0], [1, 0], [0, 1]], "not numbers in pairs"),
        ([0, 1, 2], r"shape \(N, 2\)"),
        ([[0, 0, 0]] * 4, r"shape \(N, 2\)"),
        (np.zeros((100_001, 2)), "at most 100000"),
    ],
)
def test_bad_polygons(points: object, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message) as caught:
        Target.from_polygon(points, source="my polygon")  # type: ignore[arg-type]
    assert str(caught.value).startswith("my polygon: ")


@settings(max_examples=7, deadline=None)
@given(star_shapes())
def test_raster_round_trip(tmp_path_factory: pytest.TempPathFactory, points: np.ndarray) -> None:
    low, extent = points.min(axis=0), np.ptp(points, axis=0).max()
    drawn = (points - low) / extent * 320 + 40
    image = Image.new("L", (1600, 1600), 255)
    # Pillow's integers are pixel centres, and its fill takes the boundary's pixels in.
    ImageDraw.Draw(image).polygon([tuple(4 * xy - 0.5) for xy in drawn], fill=0)
    path = tmp_path_factory.mktemp("raster") / "shape.png"
    image.reduce(4).save(path)
    target = Target.read(path)
    assert iou(target.outline, drawn) > 0.98
    assert iou(target.normal, Target.from_polygon(drawn, y_down=True).normal) > 0.98
