"""Stars are of what the user brought: parts that the reading left out count as lost."""

from __future__ import annotations

from typing import Any

import pytest

from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import EscherTile, Likeness, Rating, Target, Tile
from orbiflow.tiles.search.finished_tiles import rated
from orbiflow.tiles.silhouette import left_out_share

BODY = "M10 60 60 60 60 90 10 90Z"


def target(*others: str) -> Target:
    path = " ".join((BODY, *others))
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path d="{path}"/></svg>'
    return Target.from_bytes(svg.encode(), "a.svg")


@pytest.mark.parametrize(
    ("others", "share", "stars"),
    [
        ((), 0.0, 5.0),
        (("M80 10 81 10 81 11Z",), 0.0, 5.0),  # a speck
        (("M70 10 80 10 80 20Z",), 50 / 1550, 5.0),
        (("M10 20 60 20 60 40 10 40Z",), 0.4, 3.0),
        (("M10 20 60 20 60 40 10 40Z", "M70 40 90 40 90 90 70 90Z"), 2000 / 3500, 2.0),
    ],
)
def test_stars_fall_with_what_was_left_out(
    bent_tile: Any, others: tuple[str, ...], share: float, stars: float
) -> None:
    read = target(*others)
    assert left_out_share(read) == pytest.approx(share, abs=1e-3)
    tile = EscherTile(bent_tile("IH4"), likeness=Likeness(known_score=0.98))
    (found,) = rated([tile], read)
    whole = rated([tile], target())[0].rating
    assert found.rating is not None
    assert whole is not None
    assert found.rating.stars == pytest.approx(stars * whole.stars / 5, abs=0.25)


def test_a_line_never_has_stars() -> None:
    line = Target.from_polygon([[0, 0], [100, 0], [100, 2], [0, 2]])
    tile = EscherTile(Tile(line.outline, wallpaper_group("p1")), likeness=Likeness(known_score=0.9))
    (own,) = rated([tile], line)
    assert own.rating == Rating(1)
