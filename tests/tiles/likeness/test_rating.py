"""Stars, words and scores: in one order, and near to what judges said of a thousand tiles."""

from __future__ import annotations

import json
import math
from dataclasses import fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import spearmanr

from orbiflow.arrays import Array
from orbiflow.tiles import Fidelity, Rating
from orbiflow.tiles.likeness.rating import STAR_WORDS
from refusals import refused

DATA = Path(__file__).parents[3] / "benchmarks" / "data"
SCORES = st.lists(st.floats(0, 1), min_size=1, max_size=12)


@given(SCORES)
def test_stars_follow_the_order_of_scores(scores: list[float]) -> None:
    ratings = [Rating.of_likeness(score) for score in sorted(scores, reverse=True)]
    stars = [rating.stars for rating in ratings]
    assert stars == sorted(stars, reverse=True)
    words = [list(STAR_WORDS.values()).index(rating.word) for rating in ratings]
    assert words == sorted(words)


@given(st.floats(0, 10))
def test_stars_are_written_in_halves(mark: float) -> None:
    rating = Rating.of_mark(mark)
    assert len(str(rating).rstrip("½")) + str(rating).count("½") / 2 == rating.stars


@pytest.mark.parametrize("stars", [0, 0.5, 5.5, 3.2, math.nan, "4", True])
def test_other_stars_are_refused(stars: Any) -> None:
    with refused("stars"):
        Rating(stars)


def test_scores_span_the_stars() -> None:
    assert Rating.of_likeness(0).stars == 1
    assert Rating.of_likeness(1).stars == 5
    words = [Rating.of_likeness(score).word for score in (0.95, 0.6, 0.2, 0.02)]
    assert words == ["excellent", "good", "fair", "poor"]


@pytest.fixture(name="marked", scope="module")
def marked_fixture() -> list[Marked]:
    """A pool of tiles from bad to good, of the silhouettes that the order was learned from."""
    silhouettes = json.loads((DATA / "likeness_pool.json").read_text("utf-8"))["silhouettes"]
    return [
        Marked.of(own["tiles"], [list(tile["marks"].values()) for tile in own["tiles"]])
        for own in silhouettes.values()
        if own["part"] == "learn"
    ]


@pytest.fixture(name="shown", scope="module")
def shown_fixture() -> list[Marked]:
    """Tiles that the search shows."""
    silhouettes = json.loads((DATA / "likeness_ranks.json").read_text("utf-8"))
    ours = [[t for t in tiles if t["method"] == "ours"] for tiles in silhouettes.values()]
    return [Marked.of(tiles, [tile["marks"] for tile in tiles]) for tiles in ours]


class Marked(NamedTuple):
    """The scores (n,) of a silhouette's tiles, and the marks (n, 2) that two judges gave."""

    scores: Array
    marks: Array
    length: float  # of the silhouette's outline

    @classmethod
    def of(cls, tiles: list[dict[str, Any]], marks: list[list[float]]) -> Marked:
        scores = [_kept(tile["values"]).score for tile in tiles]
        return cls(np.array(scores), np.array(marks), tiles[0]["values"]["length"])


def _kept(values: dict[str, Any]) -> Fidelity:
    names = {field.name for field in fields(Fidelity)}
    return Fidelity(**{name: values[name] for name in names})


def test_the_order_is_that_of_the_judges(marked: list[Marked], shown: list[Marked]) -> None:
    for silhouettes, mean, tenth, less in ((marked, 0.71, 0.45, 0.5), (shown, 0.55, 0.1, 0.4)):
        means = [(one.scores, one.marks.mean(axis=1)) for one in silhouettes]
        ranks = [spearmanr(scores, marks).statistic for scores, marks in means]
        assert np.mean(ranks) > mean
        assert np.quantile(ranks, 0.1) > tenth
        first = [marks.max() - marks[scores.argmax()] for scores, marks in means]
        assert np.mean(first) < less


def test_a_score_is_the_share_of_marks_that_are_good(shown: list[Marked]) -> None:
    scores = np.concatenate([one.scores for one in shown])
    good = np.concatenate([(one.marks >= 6.5).mean(axis=1) for one in shown])
    for tenth in np.array_split(np.argsort(scores), 10):
        assert good[tenth].mean() == pytest.approx(scores[tenth].mean(), abs=0.08)
