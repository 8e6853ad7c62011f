"""The choice among finalists."""

from dataclasses import replace

import pytest
import shapely
import torch

from orbiflow.errors import CertificationError
from orbiflow.tiles import CLASSES, EscherTile, Fit, Target, TileModel, certify
from orbiflow.tiles.search.finished_tiles import best_tiles
from refusals import refused

KIND = CLASSES["IH21"]


def best_tile(
    target: Target, model: TileModel, *, starts: int, seconds: float, force: bool = False
) -> EscherTile:
    fit = Fit(model, starts, 0, model.size)
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
