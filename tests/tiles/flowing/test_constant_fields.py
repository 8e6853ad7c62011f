"""Omega = 0: pose and lattice alone (the paper shows it as the least frequency)."""

import numpy as np
import pytest
import torch

from orbiflow.tiles import (
    CLASSES,
    ClassFailure,
    OccupancySearch,
    OverlapSearch,
    SearchMethod,
    Target,
    TileModel,
    as_map,
    as_model,
    certify,
    escherize_class,
    load_model,
)
from orbiflow.tiles.flowing.tile_model import extract_tile

BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
TARGET = Target.from_polygon(BOOT)
SETTINGS: dict[str, SearchMethod] = {
    "descent": OverlapSearch.for_effort(
        "fast", max_frequency=0, stages=((6, 2), (6, 1)), polish=5, projected=100, measured=30
    ),
    "descent from the template": OverlapSearch.for_effort(
        "fast", max_frequency=0, starts="template", stages=((8, 2), (8, 1)), polish=5
    ),
    "occupancy": OccupancySearch(
        max_frequency=0, turns=2, finalists=2, affine_iterations=20, iterations=10, points=200
    ),
}


@pytest.mark.parametrize(
    ("name", "method"), list(zip(("IH3", "IH6", "IH21"), SETTINGS, strict=True))
)
def test_a_fit_of_pose_and_lattice_is_certified(name: str, method: str, tmp_path) -> None:
    result = escherize_class(TARGET, name, SETTINGS[method])
    assert not isinstance(result, ClassFailure)
    assert result.certificate.valid
    assert result.likeness.metrics.iou > 0.3
    path = tmp_path / "model.safetensors"
    assert result.map is not None
    path.write_bytes(result.map.to_bytes())
    model = load_model(path)
    assert model.max_frequency == 0
    # a constant field moves all points alike
    points = torch.rand(1, 9, 2, dtype=torch.float64)
    moved = model.flow(points).detach() - points
    assert (moved - moved[:, :1]).abs().max() < 1e-12


@pytest.mark.parametrize("name", CLASSES)
def test_a_model_without_waves(name: str) -> None:
    model = TileModel(name, 0.4, max_frequency=0, segments=2)
    points = torch.rand(1, 5, 2, dtype=torch.float64)
    assert (model.inverse(model(points)) - points).abs().max() < 1e-12
    tile, fine = extract_tile(model)
    assert certify(tile).valid
    again = as_model(as_map(fine))
    assert np.array_equal(extract_tile(again)[0].polygon, tile.polygon)
