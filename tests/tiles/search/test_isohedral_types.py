"""The 81 isohedral types: their templates, the linear spaces of their tiles, and certificates."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.runtime import Note
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    CLASSES,
    ISOHEDRAL_TYPES,
    EscherTile,
    IsohedralClass,
    Tile,
    certify,
    complex_points,
    escherize,
    escherize_class,
    isohedral_class,
    near_symmetry,
    plane_points,
    read_result,
    save_tiles,
    signed_area,
    subdivided,
)
from orbiflow.tiles.finding import classes
from orbiflow.tiles.flowing import OverlapSearch
from orbiflow.tiles.search import EscherizeSettings, LikenessSearch, Placements, TileSpace
from orbiflow.tiles.silhouette import outlines, sampled
from outlines import animal
from refusals import refused
from small_searches import FEW
from strategies import seeds

MARKED = (19, 35, 48, 60, 63, 65, 70, 75, 80, 87, 89, 92)
PER_EDGE = 4
NEAR = {"bat_60": "D1", "penguin_60": "C1", "camel_60": "C1", "spider_120": "C1"}


def random_tile(kind: IsohedralClass, seed: int, size: float = 0.03) -> Tile:
    """A tile near the template: the template's parameters in the linear space, changed at random."""
    template = kind.template()
    lengths = np.full((1, len(template)), PER_EDGE)
    space = TileSpace(kind, Placements(lengths, np.zeros(1, int), np.zeros(1)))
    goal = complex_points(subdivided(template[None], PER_EDGE)[0])
    real, imaginary = space.matrices(0)
    stacked = np.concatenate([real, imaginary])
    parameters = np.linalg.lstsq(stacked, np.concatenate([goal.real, goal.imag]), rcond=None)[0]
    parameters += size * np.random.default_rng(seed).normal(size=len(parameters))
    linear, offset = space.group(0, parameters)
    polygon = plane_points(real @ parameters + 1j * (imaginary @ parameters))
    corners = tuple(range(0, len(polygon), PER_EDGE))
    return Tile(polygon, kind.group().conjugate(linear, offset), kind.name, corners)


def test_there_are_81_types_and_twelve_that_need_marks() -> None:
    missing = [k for k in range(1, 94) if f"IH{k}" not in ISOHEDRAL_TYPES]
    assert tuple(missing) == MARKED
    assert all(ISOHEDRAL_TYPES[name] is kind for name, kind in CLASSES.items())
    with refused("IH19"):
        isohedral_class(19)


@pytest.mark.parametrize("name", ISOHEDRAL_TYPES)
def test_the_template_tiles_with_the_group_and_the_stabiliser_of_its_type(name: str) -> None:
    kind = ISOHEDRAL_TYPES[name]
    tile = Tile(kind.template(), kind.group())
    (stabiliser,) = tile.tiling.stabilisers
    assert certify(tile).valid
    assert stabiliser.order == len(kind.stabiliser)
    assert all(any(s.is_close(t, 1e-9) for t in stabiliser.elements) for s in kind.stabiliser)
    named = wallpaper_group(kind.group_name)
    same = (
        sorted((round(np.trace(g.linear)), round(g.determinant)) for g in group.cosets)
        for group in (kind.group(), named)
    )
    first, second = same
    assert first == second
    assert signed_area(kind.template()) == pytest.approx(1.5 * np.sqrt(3.0))
    covered = [edge for own in kind.edge_classes for edge in own.edges]
    assert sorted(covered) == list(range(len(kind.template())))


@pytest.mark.parametrize("name", CLASSES)
def test_symbols_of_the_nine_give_the_edges_of_the_paper(name: str) -> None:
    """Both come from different books, and each says which edge is which image of which."""
    paper, symbol = CLASSES[name], IsohedralClass(name, CLASSES[name].row)
    assert symbol.group().order == paper.group().order

    def pairs(kind: IsohedralClass) -> set[tuple[frozenset[int], str]]:
        return {(frozenset((p.first, p.second)), p.kind) for p in kind.identified_edges}

    kinds = len(paper.template())
    turned = [
        {(frozenset((sign * k + shift) % kinds for k in edge), how) for edge, how in pairs(paper)}
        for shift in range(kinds)
        for sign in (1, -1)
    ]
    assert pairs(symbol) in turned


@pytest.mark.parametrize("name", ISOHEDRAL_TYPES)
@settings(max_examples=2)
@given(seed=seeds)
def test_random_tiles_are_certified_with_their_stabiliser(name: str, seed: int) -> None:
    kind = ISOHEDRAL_TYPES[name]
    tile = random_tile(kind, seed)
    assume(shapely.is_valid(shapely.Polygon(tile.polygon)))
    order = len(kind.stabiliser)
    assert certify(tile).valid
    assert tile.tiling.stabilisers[0].order == order
    assert len(tile.tiling.aspects) * order == kind.group().order
    whole = signed_area(tile.polygon) * kind.group().order / order
    assert whole == pytest.approx(tile.group.cell_volume, rel=1e-12)


def test_symmetric_silhouettes_are_told_from_others() -> None:
    goals = {name: near_symmetry(animal(f"nagata/{name}.dat").normal) for name in NEAR}
    assert {name: near.stabiliser for name, near in goals.items()} == NEAR
    letter = np.array([[1, 0], [1, 3], [3, 3], [3, 4], [0, 4], [0, 1], [-2, 1], [-2, 0]], float)
    turned = near_symmetry(letter / np.sqrt(signed_area(letter)))
    assert turned.half_turn > 0.95 > turned.mirror
    assert turned.stabiliser == "C2"


def test_a_silhouette_near_to_symmetric_gets_classes_of_symmetric_tiles(monkeypatch) -> None:
    asked: list[str] = []

    def failing(*arguments: Any) -> None:
        asked.append(arguments[2].name)  # after the method and the goal
        raise CertificationError("no")

    monkeypatch.setattr(LikenessSearch, "fit", failing)
    monkeypatch.setattr(LikenessSearch, "preview", lambda *_: None)
    notes: list[str] = []

    def searched(name: str, **changes: Any) -> list[str]:
        asked.clear()
        notes.clear()
        escherize(
            animal(f"nagata/{name}.dat"),
            EscherizeSettings(**changes),
            on_event=lambda event: notes.append(event.text) if isinstance(event, Note) else None,
        )
        return list(dict.fromkeys(asked))  # rounded ones follow

    assert searched("bat_60") == [*CLASSES, "IH13", "IH12", "IH69"]
    assert "its mirror image (likeness 0.8" in notes[0]
    assert searched("camel_60") == list(CLASSES)
    assert notes == []
    assert searched("camel_60", classes=("all",)) == [
        *(*CLASSES, "IH13", "IH12", "IH69"),
        *("IH8", "IH9"),
    ]
    assert searched("bat_60", classes=("IH26",)) == ["IH26"]
    assert not OverlapSearch.takes_symmetric


def test_the_search_gives_symmetric_tiles_that_are_saved_and_loaded(tmp_path: Path) -> None:
    quick = LikenessSearch(**FEW)
    bat = animal("nagata/bat_60.dat")
    tile = escherize_class(bat, "IH13", quick)
    assert isinstance(tile, EscherTile)
    assert tile.certificate.valid
    assert tile.tile.tiling.stabilisers[0].order == 2
    loaded = read_result(save_tiles([tile], tmp_path / "bat"))
    assert loaded.isohedral_class == "IH13"
    assert loaded.certificate.valid
    assert tile.map is not None
    assert loaded.tile.tiling.stabilisers[0].order == 2


@pytest.mark.parametrize(("step", "points"), [(6, 114), (12, 108)])
def test_every_class_divides_the_points_of_outlines_that_cross_themselves(
    monkeypatch: pytest.MonkeyPatch, step: int, points: int
) -> None:
    """Those that 78 points make cross themselves had 117: too many by one for pairs of edges."""
    resample = outlines.resampled

    def crossing(ring: Array, count: int, phase: float) -> Array:
        found = resample(ring, count, phase)
        return np.roll(found[::-1], 1, axis=0)[[1, 0, *range(2, count)]] if count < 80 else found

    monkeypatch.setattr(outlines, "resampled", crossing)
    side = 5.1  # so long that 78 points are asked for, or 72
    bar = np.array([[0.0, 0.0], [side, 0.0], [side, 1 / side], [0.0, 1 / side]])
    assert len(sampled(bar, step=step).coarse) == points


def test_classes_are_listed_and_drawn_by_name(tmp_path: Path, monkeypatch) -> None:
    done = classes(classes=("26", "ih8"), out=tmp_path / "two.png")
    first, second = done.summary["classes"]
    assert (first["class"], first["tile"]) == ("IH26", "D1")
    assert (first["symbol"], first["mirrors"], first["rotations"]) == ("a+a-b+cb- a+b-c", "2", "2")
    assert (second["group"], second["tile"], second["mirrors"]) == ("p2", "C2", "-")
    with Image.open(tmp_path / "two.png") as picture:
        assert picture.width > picture.height > 400
    some = {name: ISOHEDRAL_TYPES[name] for name in ("IH12", "IH26", "IH93")}
    monkeypatch.setattr("orbiflow.tiles.tilings.ISOHEDRAL_TYPES", some)
    assert [row["class"] for row in classes(classes=("all",)).summary["classes"]] == list(some)
