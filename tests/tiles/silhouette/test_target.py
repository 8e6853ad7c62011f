"""The normal form of a target, and the frame between it and the input."""

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

from orbiflow.errors import OrbiflowError
from orbiflow.tiles import Frame, Target, centroid, signed_area
from refusals import refused
from strategies import random_orthogonal, random_points, seeds


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


def test_y_down_flips_the_picture() -> None:
    # The long arm of this L points to larger y.
    points = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 5], [0, 5]]
    up, down = Target.from_polygon(points), Target.from_polygon(points, y_down=True)
    assert up.normal[:, 1].max() > -up.normal[:, 1].min()
    assert down.normal[:, 1].max() < -down.normal[:, 1].min()
    assert np.allclose(np.linalg.det(down.frame.linear), -down.area)


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


DRAWING = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="-30 10 40 20">
<rect x="-25" y="12" width="9" height="8"/></svg>"""


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    """Any similarity, and now and then a stretch."""
    rng = np.random.default_rng(draw(seeds))
    scale = 10.0 ** draw(st.floats(-6, 6))
    linear = scale * random_orthogonal(rng, 2) @ np.diag([1.0, draw(st.floats(0.5, 2))])
    return Frame(
        linear,
        scale * rng.uniform(-9, 9, 2),
        draw(st.sampled_from(["image", "svg", "polygon"])),
        draw(st.none() | st.just((640.0, 480.0))),
        tuple(rng.uniform(-5, 5, 2)),
    )


@given(frames(), seeds)
def test_there_and_back(frame: Frame, seed: int) -> None:
    points = random_points(seed, 4, 3, 2)
    assert np.abs(frame.to_normal(frame.to_input(points)) - points).max() < 1e-12 * 30
    unit = np.abs(frame.linear).max()
    placed = frame.to_input(points)
    assert np.abs(frame.to_input(frame.to_normal(placed)) - placed).max() < 1e-12 * 30 * unit
    tensor = torch.tensor(points)
    assert np.abs(frame.to_input(tensor).numpy() - placed).max() < 1e-13 * 30 * unit
    other = frame.to_normal(points)
    assert np.abs(frame.to_normal(tensor).numpy() - other).max() < 1e-12 * (
        30 + np.abs(other).max()
    )
    assert frame.to_input(tensor.float()).dtype == torch.float32


@given(frames())
def test_json_keeps_every_bit(frame: Frame) -> None:
    again = Frame.from_dict(json.loads(json.dumps(frame.as_dict())))
    assert again.as_dict() == frame.as_dict()
    assert np.array_equal(again.inverse, frame.inverse)
    assert frame.y_down == (np.linalg.det(frame.linear) < 0)


def test_what_targets_say(tmp_path: Path) -> None:
    picture, drawing = tmp_path / "a.png", tmp_path / "a.svg"
    image = Image.new("L", (60, 40), 255)
    image.paste(0, (10, 5, 30, 35))
    image.save(picture)
    drawing.write_text(DRAWING)
    frame = Target.read(picture).frame
    assert (frame.kind, frame.size, frame.corner) == ("image", (60, 40), (0, 0))
    assert frame.y_down
    assert frame.to_normal([20.0, 20.0]) == pytest.approx([0, 0], abs=1e-3)
    frame = Target.read(drawing).frame
    assert (frame.kind, frame.size, frame.corner) == ("svg", (40, 20), (-30, 10))
    frame = Target.from_polygon([[0, 0], [2, 0], [0, 2]]).frame
    assert (frame.kind, frame.size, frame.y_down) == ("polygon", None, False)


make: Any = Frame
BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "a vector": (lambda: make([1, 2], [0, 0]), r"linear must be real numbers of shape \(2, 2\)"),
    "words": (lambda: make([["a", 0], [0, 1]], [0, 0]), "linear must be real numbers"),
    "ragged": (lambda: make([[1, 0], [1]], [0, 0]), "linear must be real numbers"),
    "NaN": (lambda: make(np.eye(2), [0, np.nan]), "offset must be finite"),
    "flat": (lambda: make([[1, 2], [2, 4]], [0, 0]), "has no inverse"),
    "zero": (lambda: make(np.zeros((2, 2)), [0, 0]), "has no inverse"),
    "size": (lambda: make(np.eye(2), [0, 0], size=(0, 3)), "size must be positive"),
    "size of one": (lambda: make(np.eye(2), [0, 0], size=(3,)), "size must be real numbers"),
    "nothing": (lambda: Frame.from_dict({}), "incomplete: 'size'"),
    "a list": (lambda: Frame.from_dict([]), "incomplete"),  # pyright: ignore[reportArgumentType]
}


@pytest.mark.parametrize("case", BAD)
def test_what_makes_no_frame(case: str) -> None:
    attempt, message = BAD[case]
    with pytest.raises(OrbiflowError, match=message):
        attempt()
