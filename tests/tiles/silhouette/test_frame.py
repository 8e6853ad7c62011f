"""The frame between a normal form and the input."""

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
from orbiflow.tiles import Frame, Target
from strategies import random_orthogonal, random_points, seeds

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
    "other sense": (
        lambda: Frame.from_dict({**make(np.eye(2), [0, 0]).as_dict(), "y_down": True}),
        "y_down is True",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_makes_no_frame(case: str) -> None:
    attempt, message = BAD[case]
    with pytest.raises(OrbiflowError, match=message):
        attempt()
