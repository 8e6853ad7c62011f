"""Fitted tiles on disk."""

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from safetensors.numpy import save

from orbiflow.errors import InputFileError
from orbiflow.tiles import CLASSES, Bending, Frame, TileMap, TileModel, as_map, as_model, load_model
from orbiflow.tiles.tile_map import BENDING, FORMAT, MAX_BYTES
from refusals import refused
from sealed import sealed


def candidate(name: str, seed: int = 0, segments: int = 1, size: int = 1) -> TileModel:
    """Candidates with random parameters and a small flow."""
    rng = np.random.default_rng(seed)
    model = TileModel(
        CLASSES[name],
        torch.tensor(rng.uniform(-3, 3, size)),
        mirrored=torch.tensor(rng.random(size) < 0.5),
        max_frequency=2,
        segments=segments,
        smoothness=1.25,
        steps=12,
        method="rk3",
    )
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(torch.tensor(rng.uniform(-0.05, 0.05, parameter.shape)))
    return model


def assert_same(one: TileModel, other: TileModel) -> None:
    assert one.isohedral_class is other.isohedral_class
    assert torch.equal(one.mirror, other.mirror)
    for what in ("max_frequency", "segments", "smoothness"):
        assert getattr(one, what) == getattr(other, what)
    assert (one.flow.steps, one.flow.method) == (other.flow.steps, other.flow.method)
    mine, theirs = dict(one.named_parameters()), dict(other.named_parameters())
    assert list(mine) == list(theirs)
    assert all(torch.equal(mine[name], theirs[name]) for name in mine)


@pytest.mark.parametrize("name", CLASSES)
def test_round_trip_through_a_file(name: str, tmp_path: Path) -> None:
    model = candidate(name, 7, 2)
    path = tmp_path / "model.safetensors"
    path.write_bytes(as_map(model).to_bytes())
    loaded = load_model(path)
    assert_same(model, loaded)


def two_triangles() -> Bending:
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    sheared = square @ [[1.0, 0.0], [1 / 3, 1.0]]
    return Bending(square, sheared, np.array([[0, 1, 2], [0, 2, 3]]))


def test_the_bending_is_kept_bit_for_bit(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    bending = two_triangles()
    saved = as_map(candidate("IH4"), bending=bending)
    path.write_bytes(saved.to_bytes())
    for again in (TileMap.read(path), pickle.loads(pickle.dumps(saved))):
        assert again.bending is not None
        for name in ("rest", "images", "triangles"):
            assert np.array_equal(getattr(again.bending, name), getattr(bending, name))
        assert set(again.arrays) == set(saved.arrays)
        assert_same(as_model(again), as_model(saved))


def with_bending(name: str, array: np.ndarray | None) -> Callable[[], bytes]:
    bending = two_triangles()
    arrays = dict(zip(BENDING, (bending.rest, bending.images, bending.triangles), strict=True))

    def make() -> bytes:
        saved = as_map(candidate("IH4"))
        own = {**arrays, name: array}
        stored = {key: np.array(value) for key, value in own.items() if value is not None}
        return TileMap(saved.settings, {**saved.arrays, **stored}).to_bytes()

    return make


REST, IMAGES, TRIANGLES = BENDING
BAD_BENDINGS: dict[str, Callable[[], bytes]] = {
    "rest missing": with_bending(REST, None),
    "images missing": with_bending(IMAGES, None),
    "triangles missing": with_bending(TRIANGLES, None),
    "too many points": with_bending(REST, np.zeros((100_001, 2))),
    "too many triangles": with_bending(TRIANGLES, np.zeros((200_001, 3), dtype=np.int64)),
    "no triangles": with_bending(TRIANGLES, np.zeros((0, 3), dtype=np.int64)),
    "index too large": with_bending(TRIANGLES, np.array([[0, 1, 4]])),
    "index negative": with_bending(TRIANGLES, np.array([[0, 1, -1]])),
    "index huge": with_bending(TRIANGLES, np.array([[0, 1, 2**64 - 1]], dtype=np.uint64)),
    "index a float": with_bending(TRIANGLES, np.array([[0.0, 1.0, 2.0]])),
    "turned over": with_bending(TRIANGLES, np.array([[2, 1, 0]])),
    "flat": with_bending(TRIANGLES, np.array([[0, 0, 1]])),
    "images folded": with_bending(IMAGES, np.array([[0, 0], [1, 0], [0.2, 0.5], [0.5, 0.0]])),
    "rest NaN": with_bending(REST, np.full((4, 2), np.nan)),
    "rest in 3-D": with_bending(REST, np.zeros((4, 3))),
}


@pytest.mark.parametrize("case", BAD_BENDINGS)
def test_bad_bendings_are_refused(case: str, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes(BAD_BENDINGS[case]())
    with refused(path, kind=InputFileError):
        TileMap.read(path)


def test_single_precision_is_widened() -> None:
    model = candidate("IH5").float()
    restored = as_model(as_map(model))
    assert restored.angle.dtype == torch.float64
    assert torch.equal(restored.angle.float(), model.angle)


def test_a_stack_is_refused() -> None:
    with refused("candidate", 2):
        as_map(candidate("IH4", size=2))


def with_settings(**changes: Any) -> Callable[[], bytes]:
    def make() -> bytes:
        saved = as_map(candidate("IH4"))
        return TileMap({**saved.settings, **changes}, saved.arrays).to_bytes()

    return make


def with_array(name: str, array: np.ndarray | None) -> Callable[[], bytes]:
    def make() -> bytes:
        saved = as_map(candidate("IH4"))
        arrays = {key: value for key, value in saved.arrays.items() if key != name}
        return TileMap(
            saved.settings, arrays if array is None else {**arrays, name: array}
        ).to_bytes()

    return make


def with_metadata(metadata: dict[str, str] | None) -> Callable[[], bytes]:
    def make() -> bytes:
        arrays = as_map(candidate("IH4")).arrays
        return save({name: np.array(a) for name, a in arrays.items()}, metadata=metadata)

    return make


def good() -> bytes:
    return as_map(candidate("IH4")).to_bytes()


FIELD = "flow.segments.0.parameters_"
NESTED = "[" * 100_000 + "]" * 100_000
BAD_FILES: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "pickle": lambda: pickle.dumps({"angle": 0.0}),
    "text": lambda: b"hello, world, this is no model\n" * 9,
    "cut in the header": lambda: good()[:100],
    "cut in the data": lambda: good()[:-8],
    "one byte more": lambda: good() + b"\0",
    "header length": lambda: b"\xff" * 8 + good()[8:],
    "no metadata": with_metadata(None),
    "other format": with_metadata({"format": "pt"}),
    "no settings": with_metadata({FORMAT: "null"}),
    "settings no JSON": with_metadata({FORMAT: "{"}),
    "settings a list": with_metadata({FORMAT: "[1, 2]"}),
    "no checksum": with_metadata({FORMAT: "{}"}),
    "settings empty": lambda: sealed(with_metadata({FORMAT: "{}"})()),
    "settings nested": with_metadata({FORMAT: NESTED}),
    "unknown class": with_settings(**{"class": "IH94"}),
    "class a number": with_settings(**{"class": 1e300}),
    "other class": with_settings(**{"class": "IH28"}),
    "frequency huge": with_settings(max_frequency=10**30),
    "frequency 2.5": with_settings(max_frequency=2.5),
    "frequency other": with_settings(max_frequency=3),
    "segments two": with_settings(segments=2),
    "steps true": with_settings(steps=True),
    "method": with_settings(method="rk99"),
    "smoothness NaN": lambda: sealed(with_settings(smoothness=77.5)().replace(b"77.5", b" NaN")),
    "smoothness huge": with_settings(smoothness=1e308),
    "smoothness null": with_settings(smoothness=None),
    "frame a number": with_settings(frame=7),
    "frame empty": with_settings(frame={}),
    "frame flat": with_settings(
        frame={**Frame(np.eye(2), np.zeros(2)).as_dict(), "linear": [[1, 1], [1, 1]]}
    ),
    "angle missing": with_array("angle", None),
    "angle a vector": with_array("angle", np.zeros(1)),
    "offset too long": with_array("offset", np.zeros(3)),
    "field too long": with_array(FIELD, np.zeros(7)),
    "angle NaN": with_array("angle", np.array(np.nan)),
    "offset infinite": with_array("offset", np.array([0.0, np.inf])),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_refused(case: str, tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes(BAD_FILES[case]())
    with refused(path, kind=InputFileError):
        load_model(path)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with refused("none.safetensors", kind=InputFileError):
        load_model(tmp_path / "none.safetensors")
    with refused("cannot read", kind=InputFileError):
        load_model(tmp_path)
    large = tmp_path / "large.safetensors"
    with large.open("wb") as file:
        file.truncate(MAX_BYTES + 1)  # sparse
    with refused("large.safetensors", "67,108,865", kind=InputFileError):
        load_model(large)


@settings(max_examples=30)
@given(data=st.data())
def test_a_damaged_file_never_gives_anything_but_an_error(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    content = bytearray(good())
    header = 8 + int.from_bytes(content[:8], "little")
    position = data.draw(st.integers(0, len(content) - 1) | st.integers(0, header - 1))
    content[position] ^= data.draw(st.integers(1, 255))
    path = tmp_path_factory.mktemp("damaged") / "model.safetensors"
    path.write_bytes(content)
    with pytest.raises(InputFileError):
        load_model(path)
