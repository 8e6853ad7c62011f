"""Small inputs built after bug reports of other tools: each is read right, or refused by its cause."""

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import shapely.affinity

from orbiflow.errors import RoundedOperatorsWarning
from orbiflow.symmetry import group_from_cif, space_group
from orbiflow.tiles import Target, iou
from refusals import names, warned

TRIALS = Path(__file__).parents[1] / "data" / "trials"


def curved(*control: tuple[float, float], steps: int = 400) -> list[tuple[float, float]]:
    """Points of a cubic Bezier curve, without the first."""
    a, b, c, d = map(np.array, control)
    t = np.arange(1, steps + 1)[:, None] / steps
    return list(map(tuple, (1 - t) ** 3 * a + 3 * t * (1 - t) * ((1 - t) * b + t * c) + t**3 * d))


BACK = curved((60, 200), (110, 120), (230, 110), (320, 190))
BELLY = curved((320, 215), (230, 290), (110, 285), (60, 200))
FISH = shapely.Polygon([(60, 200), *BACK, (370, 150), (360, 250), (320, 215), *BELLY])
FIN = shapely.Polygon([(150, 150), (190, 60), (230, 150)])
CAT = shapely.Polygon(
    [(130, 300), (130, 120), (150, 80), (170, 110), (230, 110), (250, 80), (270, 120), (270, 300)]
)
L = shapely.Polygon([(40, 20), (80, 20), (80, 140), (160, 140), (160, 180), (40, 180)])
CURVES = [
    ((60, 300), (60, 120), (340, 120), (340, 260)),
    ((340, 260), (340, 380), (160, 370), (170, 270)),
]
LAST = ((170, 270), (176, 220), (260, 220), (250, 270))
SPIRAL = shapely.LineString(
    [(60, 300), *(point for curve in (*CURVES, LAST) for point in curved(*curve))]
).buffer(7, cap_style="flat")


def oval(rx: float, ry: float) -> shapely.Geometry:
    return shapely.affinity.translate(
        shapely.affinity.scale(shapely.Point(0, 0).buffer(1, 64), rx, ry), 200, 200
    )


BAR = shapely.affinity.rotate(shapely.box(300, 190, 360, 210), 30, origin=(300, 200))
BIRD = shapely.union_all([oval(120, 40), oval(20, 80), BAR])


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        *(("css-order.svg", FISH), ("css-combinators.svg", FISH), ("beyond-the-page.svg", FISH)),
        *(("namespaced-id.svg", FISH.union(FIN)), ("gradient-to-nothing.svg", CAT)),
        *(("path-length.svg", SPIRAL), ("transform-origin.svg", BIRD)),
    ],
)
def test_drawings(name: str, shape: shapely.Polygon) -> None:
    assert iou(Target.read(TRIALS / name).outline, shape) > 0.997


@pytest.mark.parametrize(
    ("name", "note"),
    [
        ("grey16-trns.png", "what is not transparent"),
        ("white16.png", "what is not transparent"),
        ("label-mask.png", "took 1 for white"),
        ("empty-first-frame.png", "took frame 2, the first that shows anything, of 2"),
    ],
)
def test_pictures(name: str, note: str) -> None:
    """The same L in each."""
    target = Target.read(TRIALS / name)
    assert iou(target.outline, L) > 0.997
    assert note in " ".join(target.notes)


def test_polygons() -> None:
    wing = Target.read(TRIALS / "naca0015.dat")
    assert not wing.y_down
    assert "title: '0015'" in " ".join(wing.notes)
    assert np.ptp(wing.outline, axis=0) == pytest.approx([1, 0.15], abs=1e-3)
    assert wing.area == pytest.approx(0.1022, abs=1e-4)
    island = Target.read(TRIALS / "island.geojson")
    assert np.ptp(island.outline, axis=0) == pytest.approx([3.6, 2.5])
    assert "360 degrees" in " ".join(island.notes)


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


@pytest.mark.usefixtures("whole_fits")
def test_towns_are_told_apart_and_close_rows_are_not_called_the_same(
    orbiflow: Callable[..., Any], tmp_path: Path
) -> None:
    kernels = ("--components", "kernels")
    fit = ("density", "fit", TRIALS / "town.csv", "--space", "sphere", *kernels)
    orbiflow.done(*fit, "--out", tmp_path / "town")
    score = ("density", "score", TRIALS / "probes.csv", "--model", tmp_path / "town")
    orbiflow.done(*score, "--out", tmp_path / "scores.csv")
    table = np.loadtxt(tmp_path / "scores.csv", delimiter=",", skiprows=1)
    first, between, second, near, far = table[:, 2]
    assert min(first, second) > between + 5 > near > far - 1e-9
    space = ("--space", "torus", "--unit", "radians")
    close = ("density", "fit", TRIALS / "close.csv", *space, *kernels)
    done = orbiflow.done(*close, "--out", tmp_path / "close")
    assert "same value" not in done.out
    assert "repeat" not in done.out


def test_names_of_groups() -> None:
    assert space_group("P2_1") == space_group(4)
    assert group_from_cif(TRIALS / "p21.cif").name == "P 1 21 1"
    with warned("0.3333", "1/3", kind=RoundedOperatorsWarning):
        rounded = group_from_cif(TRIALS / "rounded.cif")
    assert rounded.order == 3
    volume = 10 * 10 * 12 * math.sin(math.pi / 3)
    assert abs(np.linalg.det(rounded.lattice)) == pytest.approx(volume / 3)
