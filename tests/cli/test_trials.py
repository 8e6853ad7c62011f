"""Small inputs built after bug reports of other tools: each is read right, or refused by its cause."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from refusals import names

TRIALS = Path(__file__).parents[1] / "data" / "trials"


@pytest.fixture(name="summary")
def summary_fixture(orbiflow: Callable[..., Any], tmp_path: Path):
    """The figures of `orbiflow density summary`, or its error."""

    def run(name: str, space: str, *options: str) -> Any:
        file = tmp_path / "summary.json"
        words = ("density", "summary", TRIALS / name, "--space", space, *options)
        done = orbiflow(*words, "--out", file)
        return json.loads(file.read_text()) if done.status == 0 else done.err

    return run


DEGREES = ("--unit", "degrees")


def test_numerals(summary) -> None:
    names(summary("american.csv", "torus", *DEGREES), "run=ignore", "heading=angle:degrees")
    names(summary("american.csv", "torus", "--columns", "heading=angle:degrees"), "1,025")
    for name, space in (("german.csv", "torus"), ("unicode-minus.csv", "sphere")):
        names(summary(name, space), "line", "--decimal ,")
    names(summary("german.csv", "torus", "--decimal", ","), "line 2", "1.025,2")
    comma = ("--decimal", ",")
    (lat, lon) = summary("unicode-minus.csv", "sphere", *comma)["directions"][0]["mean"]
    assert (lat, lon) == (pytest.approx(-33.7, abs=0.1), pytest.approx(-70, abs=0.1))
    (excel,) = summary("sep-line.csv", "sphere", *comma)["directions"]
    assert excel["rows"] == 60
    assert excel["mean"] == pytest.approx([47.4, 10.7], abs=0.1)


def test_columns_and_units(summary) -> None:
    (taxi,) = summary("taxi.csv", "sphere")["directions"]
    assert taxi["mean"] == pytest.approx([40.74, -73.98], abs=0.01)
    (stars,) = summary("stars.csv", "sphere")["directions"]
    assert stars["mean"] == pytest.approx([-25.3, 59.6], abs=0.1)
    names(summary("radians.csv", "sphere"), "radians", "--unit degrees")
    assert summary("latitude-90.0000025.csv", "sphere")["directions"][0]["rows"] == 60


def test_codes_counts_and_rounded_directions(summary) -> None:
    said = summary("wind-999.csv", "torus", *DEGREES)
    names(said, "990", "5 such rows", "999", "9 such rows", "--missing-codes 990,999")
    codes = ("--missing-codes", "990,999", "--drop-missing")
    assert summary("wind-999.csv", "torus", *DEGREES, *codes)["columns"][0]["rows"] == 70
    words = "angle=angle:radians,count=count"
    names(summary("binned.csv", "torus"), words)
    (binned,) = summary("binned.csv", "torus", "--columns", words)["columns"]
    assert binned["rayleigh_p"] == pytest.approx(0.0079, abs=1e-4)
    (north,) = summary("north-0-and-360.csv", "torus", *DEGREES)["columns"]
    assert north["mean"] == pytest.approx(359.65, abs=0.01)
