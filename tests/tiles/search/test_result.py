"""From a fit, by any method, to certified polygons, their choice and their stars."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import shapely
import torch

from orbiflow.errors import CertificationError
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    CLASSES,
    ClassFinalists,
    EscherTile,
    Likeness,
    LikenessSearch,
    OccupancySearch,
    OverlapSearch,
    Rating,
    Target,
    Tile,
    TileModel,
    certified_tiles,
    certify,
    fit_tile,
    trainable,
)
from orbiflow.tiles.search.finished_tiles import best_tiles, rated
from orbiflow.tiles.silhouette import left_out_share
from outlines import searched
from refusals import refused
from small_searches import FEW

KIND = CLASSES["IH21"]


def best_tile(
    target: Target, model: TileModel, *, starts: int, seconds: float, force: bool = False
) -> EscherTile:
    fit = ClassFinalists(model, starts, 0, model.size)
    found = best_tiles(target, fit, force=force)[0]
    return found.changed(search=replace(found.search, seconds=seconds))


def finalists(*shapes: float, angles: tuple[float, ...] | None = None) -> TileModel:
    """Candidates without a flow; a shape of 2 makes the template cross itself."""
    turns = torch.tensor(angles or (0.0,) * len(shapes), dtype=torch.float64)
    model = TileModel(KIND, turns, max_frequency=1)
    with torch.no_grad():
        model.shape.add_(torch.tensor(shapes)[:, None])
    return model


@pytest.mark.parametrize("y_down", [False, True])
def test_the_best_of_the_certified_wins(y_down: bool) -> None:
    # input units 30 times larger and far from the origin
    target = Target.from_polygon(30 * KIND.template() + 500, y_down=y_down)
    sign = -1.0 if y_down else 1.0
    model = finalists(2.0, 0.0, 0.02, -0.02, angles=(0.0, 0.4, 0.1, 0.9))
    result = best_tile(target, model, starts=24, seconds=1.5)
    single = [
        best_tile(target, model.take([i]), starts=24, seconds=1.5).likeness.metrics.iou
        for i in (1, 2, 3)
    ]
    assert result.likeness.metrics.iou == max(single)
    assert min(single) < max(single)
    assert (result.search.dropped, result.search.starts, result.search.seconds) == (1, 24, 1.5)
    assert (result.name, result.group_name) == ("IH21", "p6")
    assert result.certificate.valid
    # the same tile in both frames
    moved = target.to_input(result.normal_tile.polygon)
    assert abs(result.tile.polygon - moved).max() < 1e-9
    assert sign * result.tile.signed_area == pytest.approx(target.area, rel=1e-9)
    assert certify(result.normal_tile).valid
    tile, goal = shapely.Polygon(result.tile.polygon), shapely.Polygon(target.outline)
    iou = tile.intersection(goal).area / tile.union(goal).area
    assert result.likeness.metrics.iou == pytest.approx(iou, abs=1e-12)


def test_no_certified_finalist() -> None:
    target = Target.from_polygon(KIND.template())
    with refused("IH21", kind=CertificationError) as caught:
        best_tile(target, finalists(2.0, 2.5), starts=2, seconds=0.0)
    assert str(caught.value).count("crosses itself") == 1  # the same reason is given once


def test_force_prefers_the_certified() -> None:
    # the crossing tile covers the target better than the certified one, which is moved away
    target = Target.from_polygon(KIND.template())
    model = finalists(2.0, 0.0)
    with torch.no_grad():
        model.offset[1] += 0.8
    worse = best_tile(target, model.take([0]), starts=1, seconds=0.0, force=True)
    result = best_tile(target, model, starts=1, seconds=0.0, force=True)
    assert result.certificate.valid
    assert result.likeness.metrics.iou < worse.likeness.metrics.iou
    assert result.search.dropped == 0


BODY = "M10 60 60 60 60 90 10 90Z"


@cache
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


BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
TARGET = Target.from_polygon(BOOT)
SETTINGS = {
    "bending": LikenessSearch(**FEW),
    "descent": OverlapSearch.for_effort("fast", stages=((2, 2), (2, 1)), polish=0),
    "occupancy": OccupancySearch(
        max_frequency=3, turns=3, finalists=2, iterations=15, affine_iterations=20, points=200
    ),
}


@pytest.mark.parametrize("method", SETTINGS)
def test_the_two_steps_give_what_the_search_gives(method: str) -> None:
    settings = SETTINGS[method]
    found = fit_tile(TARGET, "IH4", settings)
    tiles = certified_tiles(TARGET, found)
    assert all(certify(tile.tile).valid for tile in tiles)
    (best,), _ = searched(TARGET, ["IH4"], settings)
    assert np.array_equal(tiles[0].tile.polygon, best.tile.polygon)


def test_a_model_may_be_trained_before_it_is_certified() -> None:
    model = trainable(fit_tile(TARGET, 4, SETTINGS["occupancy"]).candidates)
    before = certified_tiles(TARGET, model)[0]
    with torch.no_grad():
        model.angle.add_(0.3)
    after = certified_tiles(TARGET, model)[0]
    assert after.certificate.valid
    assert not np.allclose(after.tile.polygon[0], before.tile.polygon[0])


def test_folded_candidates_are_refused_unless_forced() -> None:
    model = TileModel("IH21", torch.zeros(2), max_frequency=1)
    with torch.no_grad():
        model.shape.add_(2.0)
    with refused("IH21", kind=CertificationError):
        certified_tiles(TARGET, model)
    forced = certified_tiles(TARGET, model, force=True)
    assert not forced[0].certificate.valid
    assert forced[0].certificate.reasons


def test_arguments_are_checked() -> None:
    with refused("target", "boot"):
        fit_tile("boot", "IH4")  # pyright: ignore[reportArgumentType]
    with refused("IH94"):
        fit_tile(TARGET, "IH94")
    with refused("method", "fast"):
        fit_tile(TARGET, "IH4", "fast")  # pyright: ignore[reportArgumentType]
    with refused("Fit", 3):
        certified_tiles(TARGET, 3)  # pyright: ignore[reportArgumentType]
