"""From a fit, by any method, to certified polygons."""

import numpy as np
import pytest
import torch

from orbiflow.errors import CertificationError
from orbiflow.tiles import (
    LikenessSearch,
    OccupancySearch,
    OverlapSearch,
    Target,
    TileModel,
    certified_tiles,
    certify,
    fit_tile,
    trainable,
)
from outlines import searched
from refusals import refused
from small_searches import FEW

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
