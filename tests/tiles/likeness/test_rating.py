"""Stars and words: in the order of scores, spread over a run, and near to what judges said."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import spearmanr

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import EscherTile, Fidelity, Rating, SearchResult, Target, Tile, rank_score
from orbiflow.tiles.likeness import likeness_ratings
from orbiflow.tiles.likeness.ranking import WORDS
from orbiflow.tiles.search.finished_tiles import rated

MARKS = Path(__file__).parents[3] / "benchmarks" / "data" / "likeness_marks.json"
SCORES = st.lists(st.floats(0, 1), min_size=1, max_size=12)


@given(SCORES, st.floats(1, 100))
def test_stars_follow_the_order_of_scores(scores: list[float], length: float) -> None:
    ordered = sorted(scores, reverse=True)
    ratings = likeness_ratings(ordered, length)
    stars = [rating.stars for rating in ratings]
    assert stars == sorted(stars, reverse=True)
    words = [list(WORDS.values()).index(rating.word) for rating in ratings]
    assert words == sorted(words)


@given(st.floats(0, 10))
def test_stars_are_written_in_halves(mark: float) -> None:
    rating = Rating.of_mark(mark)
    assert len(str(rating).rstrip("½")) + str(rating).count("½") / 2 == rating.stars


@pytest.mark.parametrize("stars", [0, 0.5, 5.5, 3.2, math.nan, "4", True])
def test_other_stars_are_refused(stars: Any) -> None:
    with pytest.raises(OrbiflowError, match="stars"):
        Rating(stars)


def test_tiles_with_legs_have_stars_too() -> None:
    # a spider's nine tiles, all of which had a score of .09 and less
    scores = [0.09, 0.03, 0.02, 0.016, 0.009, 0.005, 0.0004]
    stars = [rating.stars for rating in likeness_ratings(scores, 13.1)]
    assert stars[0] >= 3.5
    assert len(set(stars)) >= 5
    # and the best of a run is not always good
    assert likeness_ratings([0.001], 7.0)[0].word == "poor"
    assert likeness_ratings([0.99], 7.0)[0].stars == 5


def test_a_blob_for_a_spider_is_poor() -> None:
    target = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
    scores = (0.83, 0.66, 0.5, rank_score(0.64, 0.36))
    tiles = [EscherTile(Tile(target.outline, wallpaper_group("p1")), known_score=s) for s in scores]
    words = [tile.rating and tile.rating.word for tile in SearchResult(target, tiles).tiles]
    assert words == ["excellent", "good", "fair", "poor"]


def test_stars_agree_with_marks_as_the_docs_say() -> None:
    silhouettes = json.loads(MARKS.read_text("utf-8"))
    pairs: list[tuple[float, float]] = []
    for name, rows in silhouettes["silhouettes"].items():
        own = [row for row in rows if "cost" in row]
        scores = [
            Fidelity(tuple(r["pieces"]), r["notches"], r["narrowed"], r["necks"], r["cost"]).score
            for r in own
        ]
        found = likeness_ratings(scores, silhouettes["lengths"][name])
        marks = (np.mean(row["marks"]) for row in own)
        pairs += [(a.stars, b) for a, b in zip(found, marks, strict=True)]
    stars, marks = np.array(pairs).T
    assert spearmanr(stars, marks).statistic > 0.74
    said = [Rating.of_mark(mark).word for mark in marks]
    place = list(WORDS.values()).index
    apart = [abs(place(Rating(s).word) - place(w)) for s, w in zip(stars, said, strict=True)]
    assert np.mean(np.array(apart) <= 1) > 0.93


def test_a_line_never_has_stars() -> None:
    line = Target.from_polygon([[0, 0], [100, 0], [100, 2], [0, 2]])
    tile = EscherTile(Tile(line.outline, wallpaper_group("p1")), known_score=0.9)
    (own,) = rated([tile], line)
    assert own.rating == Rating(1)
