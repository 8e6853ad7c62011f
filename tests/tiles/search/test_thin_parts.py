"""A class that has no tile with all thin parts of a silhouette gets one without them, and says so."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import Cancel
from orbiflow.tiles import (
    ClassFinalists,
    Emphasis,
    EscherizeSettings,
    LikenessSearch,
    Pins,
    Rating,
    SearchResult,
    Target,
    complex_points,
    escherize,
    fidelity,
    fit_tile,
    index_page,
    iou,
    polygons_in,
    read_result,
    resampled,
    save_tiles,
)
from orbiflow.tiles.flowing.starts import template_starts
from orbiflow.tiles.likeness import fidelity_to_original
from orbiflow.tiles.search import (
    Goal,
    OnProgress,
    SearchMethod,
    StillTiles,
    finished_tiles,
    rounded_for,
    why_poor,
)
from orbiflow.tiles.search.likeness_search import ROUNDED_SHARES
from orbiflow.tiles.search.search_method import Sketches
from orbiflow.tiles.search.search_record import best_of
from orbiflow.tiles.tilings import IsohedralClass
from small_searches import FEW

HAIR = Target.from_polygon(
    [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.1, 2.8], [2.09, 4], [2.07, 2.8], [0.8, 2.5]]
)


class Hairless(SearchMethod):
    """Lay templates over silhouettes that reach no higher than a limit, in normal form."""

    highest: float

    def __init__(self, highest: float) -> None:
        self.highest = highest

    def fit(
        self, goal: Goal, kind: IsohedralClass, per_class: int, progress: OnProgress, cancel: Cancel
    ) -> ClassFinalists:
        del progress, cancel
        if goal.target.normal[:, 1].max() > self.highest:
            raise CertificationError("all tiles near the silhouette cross themselves")
        starts = template_starts(kind, turns=2, stretch=0.2)
        return ClassFinalists(StillTiles(kind, starts), len(starts), 0, per_class)

    def goals(self, goal: Goal):
        return LikenessSearch().goals(goal)


@pytest.fixture(scope="module")
def found() -> SearchResult:
    limit = (HAIR.normal[:, 1].max() + HAIR.smoothed(ROUNDED_SHARES[0]).normal[:, 1].max()) / 2
    return searched(limit)


def searched(highest: float) -> SearchResult:
    settings = EscherizeSettings(classes=("IH4", "IH6"))
    return escherize(HAIR, settings, method=Hairless(highest))


def test_such_a_class_gets_a_tile_of_what_is_left(found: SearchResult) -> None:
    assert found.failures == []
    assert [tile.likeness.smoothed for tile in found.tiles] == [ROUNDED_SHARES[0]] * 2
    assert all(tile.certificate.valid for tile in found.tiles)


def test_a_class_with_a_tile_of_the_whole_silhouette_keeps_it() -> None:
    tiles = searched(100).tiles
    assert [tile.likeness.smoothed for tile in tiles] == [0, 0]
    assert rounded_for(tiles) == ""


def test_where_nothing_helps_the_first_reason_is_given() -> None:
    none = searched(0)
    assert not none.tiles
    assert {failure.reason for failure in none.failures} == {
        "all tiles near the silhouette cross themselves"
    }


def test_a_tile_of_the_whole_silhouette_goes_first_whichever_was_found_first(
    found: SearchResult,
) -> None:
    rounded = found.tiles[0]
    whole = rounded.changed(likeness=replace(rounded.likeness, smoothed=0.0, known_score=0.0))
    for count in (1, 2):
        assert best_of(rounded, whole, count) is whole
        assert best_of(whole, rounded, count) is whole


def test_it_is_said_and_kept(found: SearchResult, tmp_path: Path) -> None:
    words = rounded_for(found.tiles)
    assert words.startswith("no tile of IH")
    assert "narrower than 2 % of its length was rounded off" in words
    assert "narrower than 2 % of its length was rounded off" in index_page(
        found.tiles, [HAIR], ["IH4", "IH6"]
    )
    save_tiles(found.tiles[:1], tmp_path / "tile")
    assert read_result(tmp_path / "tile").likeness.smoothed == ROUNDED_SHARES[0]


def test_a_blob_is_no_good_likeness_of_a_spider() -> None:
    """Tiles of what is left without legs are rated by how much they are like the whole."""
    from orbiflow.tiles.search.finished_tiles import best_tiles

    body = shapely.Point(0, 0).buffer(40)
    turns = 2 * np.pi * (np.arange(8) + 0.3) / 8
    legs = shapely.MultiLineString([[(0, 0), (150 * np.cos(t), 150 * np.sin(t))] for t in turns])
    (shape,) = polygons_in(body.union(legs.buffer(2)))
    whole = shapely.get_coordinates(shape.exterior)[:-1]
    spider = Target.from_polygon(whole)
    rounded = spider.smoothed(0.04)
    assert rounded.area < 1.1 * body.area
    fit = fit_tile(
        rounded, "IH4", LikenessSearch(**{**FEW, "placements": 30, "held": 6, "rounds": 4})
    )
    (blind,) = best_tiles(rounded, fit)
    (rated,) = best_tiles(rounded, fit, original=spider, smoothed=0.04)
    assert Rating.of_likeness(blind.score).stars >= 3
    assert Rating.of_likeness(rated.score).stars == 1
    assert rated.likeness.metrics.iou == pytest.approx(iou(rated.tile.polygon, spider.outline))
    assert rated.likeness.recognisability.limbs < 0.3 < 0.7 < blind.likeness.recognisability.limbs
    assert why_poor(rated.changed(rating=Rating.of_likeness(rated.score)))


@given(st.floats(0, 2 * np.pi), st.floats(0.5, 2.0))
def test_rounding_that_takes_nothing_away_changes_no_rating(turn: float, size: float) -> None:
    ring = ANIMAL.without_fur
    about = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    bent = resampled(ring, 300) @ (size * about).T + (1.0, 0.1) * np.sin(4 * resampled(ring, 300))
    plain = fidelity(complex_points(resampled(ring, 300)), complex_points(bent), 0.0)
    same = fidelity_to_original(ring, resampled(ring, 300), bent, 0.02, 0.0)
    assert same.mark == pytest.approx(plain.mark, abs=0.35)


ANIMAL = Target.read(Path(__file__).parents[3] / "examples" / "silhouettes" / "squirrel.dat")


def test_what_was_said_to_matter_is_not_rounded_off() -> None:
    own, plain = LikenessSearch(), Goal(HAIR)
    spot = (2.08, 3.5, 0.6)
    assert [share for share, _ in own.goals(plain)] == [0, *ROUNDED_SHARES]
    assert [rounded.has_rounder for _, rounded in own.goals(plain)] == [True, True, False]
    assert [share for share, _ in Sketches(own).goals(plain)] == [*ROUNDED_SHARES, 0]
    pinned = replace(plain, pins=Pins.at(HAIR, [spot]))
    assert own.goals(pinned) == Sketches(own).goals(pinned) == [(0, pinned)]
    everything = Emphasis(np.ones((4, 4), np.float32), (-3.0, -3.0, 3.0, 3.0), 4.0, "mask.png")
    assert len(own.goals(replace(plain, emphasis=everything))) == 1


def test_nothing_is_left_of_a_silhouette_that_is_all_hair() -> None:
    hair = Target.from_polygon([[0, 0], [100, 0], [100, 1], [0, 1]])
    assert all(own.target is hair for _, own in LikenessSearch().goals(Goal(hair)))


@pytest.mark.usefixtures("small_searches")
def test_a_tile_without_a_map_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    def folded(*_: object) -> None:
        raise OrbiflowError("it would fold")

    monkeypatch.setattr(finished_tiles, "map_of_bent", folded)
    target = Target.from_polygon([[0, 0], [60, 0], [60, 20], [30, 25], [28, 70], [0, 70]])
    settings = EscherizeSettings(effort="fast", classes=("IH1",), workers=1)
    (tile,) = escherize(target, settings).tiles
    assert (tile.bending, tile.no_map) == (None, "it would fold")
