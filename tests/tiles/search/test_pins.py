"""Searches for likeness with parts that must not bend."""

import json
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import shapely

from orbiflow.runtime import Call, Event, call_from_json
from orbiflow.tiles import Emphasis, EscherTile, LikenessSearch, OverlapSearch, Pins
from outlines import animal, searched
from refusals import refused
from runtime.searches import check_order, run
from small_searches import FEW

SQUIRREL = animal("squirrel.dat")
HEAD = (230, 190, 140)
INSIDE = (514, 275, 20)  # a spot far from the outline
QUICK = LikenessSearch(**{**FEW, "placements": 30, "held": 6, "rounds": 8})
CLASSES = ["IH5", "IH7"]


def head_misfit(result: EscherTile, pins: Pins) -> tuple[float, float]:
    """How far the head's outline is from similar to what it was, and its turn in radians."""
    assert result.likeness.rest is not None
    assert result.likeness.bent is not None
    held = pins.holds(SQUIRREL.to_normal(result.likeness.rest))
    x, z = (
        SQUIRREL.to_normal(ring)[held] @ [1, 1j]
        for ring in (result.likeness.rest, result.likeness.bent)
    )
    x, z = x - x.mean(), z - z.mean()
    a = np.vdot(x, z) / np.vdot(x, x)
    return float(np.sqrt((abs(z - a * x) ** 2).sum() / (abs(z) ** 2).sum())), float(np.angle(a))


@pytest.fixture(scope="module", name="free")
def free_fixture() -> list[EscherTile]:
    return searched(SQUIRREL, CLASSES, QUICK)[0]


@pytest.fixture(scope="module", name="pinned")
def pinned_fixture() -> list[EscherTile]:
    return searched(SQUIRREL, CLASSES, QUICK, pins=Pins.at(SQUIRREL, [HEAD]))[0]


def test_a_pinned_head_keeps_its_shape(free: list[EscherTile], pinned: list[EscherTile]) -> None:
    pins = Pins.at(SQUIRREL, [HEAD])
    assert len(free) == len(pinned) == 2
    for result in pinned:
        assert result.certificate.valid
        assert result.likeness.pinned is not None
        assert result.likeness.pinned < 0.02
    worst = max(head_misfit(result, pins)[0] for result in pinned)
    best = min(head_misfit(result, pins)[0] for result in free)
    assert worst < best / 5
    assert {result.likeness.pinned for result in free} == {None}


def test_the_tile_itself_has_the_head(pinned: list[EscherTile]) -> None:
    """Not only the bent silhouette: the certified polygon holds a copy of the pinned outline."""
    pins = Pins.at(SQUIRREL, [HEAD])
    for result in pinned:
        assert result.likeness.rest is not None
        assert result.likeness.bent is not None
        held = pins.holds(SQUIRREL.to_normal(result.likeness.rest))
        x, z = (ring[held] @ [1, 1j] for ring in (result.likeness.rest, result.likeness.bent))
        a = np.vdot(x - x.mean(), z - z.mean()) / np.vdot(x - x.mean(), x - x.mean())
        copy = a * (x - x.mean()) + z.mean()
        boundary = shapely.Polygon(result.tile.polygon).exterior
        far = shapely.distance(shapely.points(np.stack([copy.real, copy.imag], 1)), boundary)
        assert far.mean() < 0.01 * np.sqrt(SQUIRREL.area)


def test_a_small_pin_inside_is_heeded() -> None:
    def strain(pins: Pins | None) -> float:
        """How far the map is from conformal at the spot: w = a z + b conj(z) + c there."""
        (tile,) = searched(SQUIRREL, CLASSES[:1], QUICK, pins=pins)[0]
        assert tile.bending is not None
        spot = shapely.Point(SQUIRREL.to_normal(INSIDE[:2]))
        corners = tile.bending.rest[tile.bending.triangles]
        (around,) = np.flatnonzero(shapely.contains(shapely.polygons(corners), spot))
        index = tile.bending.triangles[around]
        z, w = (own[index] @ [1, 1j] for own in (tile.bending.rest, tile.bending.images))
        a, b, _ = np.linalg.solve(np.stack([z, z.conj(), np.ones(3)], axis=1), w)
        return min(abs(a), abs(b)) / max(abs(a), abs(b))

    assert strain(Pins.at(SQUIRREL, [INSIDE])) < strain(None) / 5


def test_a_head_that_would_turn_does_not() -> None:
    turns = []
    # a soft body does not mind its pose, so heads turn unless they are held
    settings = replace(QUICK, bodies=("soft",))
    for keep in (False, True):
        pins = Pins.at(SQUIRREL, [HEAD], keep_angle=keep)
        (result,) = searched(SQUIRREL, ["IH7"], settings, pins=pins)[0]
        turns.append(abs(head_misfit(result, pins)[1]))
    assert turns[0] > np.radians(5)
    assert turns[0] > 2 * turns[1]


def test_pins_need_a_search_where_something_bends() -> None:
    pins = Pins.at(SQUIRREL, [HEAD])
    with refused("pins"):
        searched(SQUIRREL, ["IH4"], OverlapSearch.for_effort("fast"), pins=pins)
    with refused("pins"):
        searched(SQUIRREL, ["IH4"], QUICK, pins=HEAD)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(
    ("name", "white", "strength"),
    [
        ("squirrel.dat", "all", 1.001),
        ("squirrel.dat", "half", 100.0),
        ("nagata/octpus_94.dat", "corner", 100.0),
    ],
)
def test_emphasis_of_any_strength_can_be_searched_with(
    name: str, white: str, strength: float
) -> None:
    target = animal(name)
    mask = np.ones((16, 16))
    if white != "all":
        mask[:, 8:] = 0
    if white == "corner":
        mask[3:] = 0
    low, high = target.normal.min(axis=0), target.normal.max(axis=0)
    emphasis = Emphasis(mask, (*low.tolist(), *high.tolist()), strength)
    hasty = LikenessSearch(**{**FEW, "carved": 1})
    results, _ = searched(target, ["IH7"], hasty, emphasis=emphasis)
    assert all(result.certificate.valid for result in results)


DOCS = Path(__file__).parents[3] / "docs"
SQUIRREL_FILE = Path(__file__).parents[3] / "examples" / "silhouettes" / "squirrel.dat"
HEAD_SPOT = "230,190,140"


def pinned_call(folder: Path, pin: str) -> Call:
    document = {
        **{"schema_version": 2, "operation": "escherize", "image": str(SQUIRREL_FILE)},
        **{"out": str(folder / "out"), "classes": ["IH4"], "effort": "fast", "workers": 1},
        "pin": [pin],
    }
    return call_from_json(document)


@pytest.mark.usefixtures("small_searches")
def test_what_was_pinned_is_told(tmp_path: Path) -> None:
    events: list[Event] = []
    run(pinned_call(tmp_path, HEAD_SPOT), events.append)
    check_order(events, "IH4")
    document = json.loads((tmp_path / "out" / "result.json").read_text())
    jsonschema.validate(document, json.loads((DOCS / "result.schema.json").read_text()))
    assert document["pins"] == {"sources": [HEAD_SPOT], "keep_angle": False, "notes": []}
    (tile,) = document["tiles"]
    assert tile["metrics"]["deformation"] > 0
    assert tile["metrics"]["pinned"] is not None


def test_a_pin_outside_is_refused_before_any_work(tmp_path: Path) -> None:
    with refused("900,20"):
        run(pinned_call(tmp_path, "900,20"))
    assert not (tmp_path / "out").exists()
