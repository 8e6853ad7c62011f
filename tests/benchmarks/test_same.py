"""What compares results with version 0.1: it finds what differs, and only that."""

import importlib
import json
import shlex
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
SQUARE = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9">{}</svg>'


@pytest.fixture(name="module")
def module_fixture(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    return importlib.import_module


@pytest.fixture(name="verdict")
def verdict_fixture(module, tmp_path: Path):
    """A function that compares two files by what `write` writes into them."""
    files = module("same_files")

    def compare(suffix: str, write, one, two, **renamed) -> str:
        paths = tmp_path / f"one{suffix}", tmp_path / f"two{suffix}"
        for path, content in zip(paths, (one, two), strict=True):
            write(path, content)
        found = files.Finding(module("same_cases").Renamed(**renamed), files.Tolerances())
        files.compare_files(*paths, "it", found)
        return found.verdict()

    return compare


def write_json(path: Path, value) -> None:
    path.write_text(json.dumps(value))


def write_text(path: Path, text: str) -> None:
    path.write_text(text)


def write_picture(path: Path, pixels) -> None:
    Image.fromarray(np.asarray(pixels, np.uint8)).save(path)


@pytest.mark.parametrize(
    ("one", "two", "expected"),
    [
        ({"a": [1, 2.5]}, {"a": [1, 2.5]}, "same bit for bit"),
        ({"a": 1.0, "seconds": 3}, {"a": 1.0, "seconds": 4}, "same bit for bit"),
        ({"a": 1.0}, {"a": 1.0 + 1e-12}, "same to 1.0e-12"),
        ({"a": 1e-16}, {"a": 0.0}, "same to 1.0e-13"),
        ({"a": [[0.0, 5.0], [1.0, 2.0]]}, {"a": [[1e-4, 5.0], [1.0, 2.0]]}, "DIFFERS"),
        ({"a": 12}, {"a": 13}, "DIFFERS"),
        ({"a": True}, {"a": 1.5}, "DIFFERS"),
        ({"a": "pg"}, {"a": "p2"}, "DIFFERS"),
        ({"a": None}, {"a": 0.0}, "DIFFERS"),
        ({"a": [1, 2]}, {"a": [1]}, "DIFFERS"),
        ({"a": 1, "b": 2}, {"a": 1}, "DIFFERS"),
        ({"a": 1}, {"a": 1, "b": 2}, "DIFFERS"),
    ],
)
def test_values_are_compared_by_their_numbers(verdict, one, two, expected: str) -> None:
    assert verdict(".json", write_json, one, two).startswith(expected)


def test_what_has_a_new_name_is_the_same(verdict) -> None:
    one, two = {"parts": ["flow"], "old": 1}, {"components": ["stream"], "new": 2}
    names = {"keys": {"parts": "components", "old": None}, "values": {"flow": "stream"}}
    assert verdict(".json", write_json, one, two, **names).startswith("DIFFERS")
    assert verdict(".json", write_json, one, two, **names, added={"new"}) == "same bit for bit"


@pytest.mark.parametrize(
    ("one", "two", "expected"),
    [
        ("x,seconds\n1,2\n", "x,seconds\n1.00000000001,3\n", "same to 1.0e-11"),
        ("x\n1\n", "x\n1\n2\n", "DIFFERS"),
        ("x\n1\n", "x\n1.1\n", "DIFFERS"),
        ("x\n1\n", "y\n1\n", "DIFFERS"),
    ],
)
def test_tables_are_compared_by_column(verdict, one: str, two: str, expected: str) -> None:
    assert verdict(".csv", write_text, one, two).startswith(expected)


@pytest.mark.parametrize(
    ("two", "expected"),
    [
        ('<path fill="#123456" d="M 1,1 L 2,2 Z"/>', "same"),
        ('<g><polygon fill="#123456" points="1,1 2,2"/></g>', "same"),
        ('<path fill="#123456" d="M1 1L2 2.1Z"/>', "DIFFERS"),
        ('<path fill="#123457" d="M1 1L2 2Z"/>', "DIFFERS"),
        ('<path fill="#123456" d="M1 1L2 2Z"/><path d="M1 1L2 3"/>', "DIFFERS"),
    ],
)
def test_drawings_are_compared_by_their_shapes(verdict, two: str, expected: str) -> None:
    one = SQUARE.format('<path fill="#123456" d="M1 1L2 2Z"/>')
    assert verdict(".svg", write_text, one, SQUARE.format(two)).startswith(expected)


def test_pictures_are_compared_by_their_pixels(verdict) -> None:
    grey = np.full((200, 200), 90)
    one_pixel, many = grey.copy(), grey.copy()
    one_pixel[3, 4] = 200
    many[:20] = 95
    assert verdict(".png", write_picture, grey, grey) == "same bit for bit"
    assert verdict(".png", write_picture, grey, one_pixel) == "same but for 2.5e-05 of pixels"
    assert verdict(".png", write_picture, grey, many).startswith("DIFFERS")
    assert verdict(".png", write_picture, grey, grey[1:]).startswith("DIFFERS")


def test_a_case_comes_after_those_that_it_reads(module) -> None:
    cases = module("same_cases").corpus()
    seen: set[str] = set()
    for case in cases:
        assert case.name not in seen
        assert case.needs <= seen | {"nowhere"}
        seen.add(case.name)


def test_command_lines_are_put_in_present_words(module) -> None:
    renamed = module("same_cases").Renamed(
        options={"--parts": "--components", "density fit --kernels": None, "-n": "--count"},
        values={"mixture": "blend"},
    )
    line = "density fit a.csv --parts kernels,mixture --kernels --level=-9 -n 5"
    expected = "density fit a.csv --components kernels,blend --level=-9 --count 5"
    words = module("same").in_present_words(shlex.split(line), renamed)
    assert words == shlex.split(expected)
