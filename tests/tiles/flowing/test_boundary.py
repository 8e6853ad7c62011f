"""From a candidate to a polygon."""

import numpy as np
import pytest
import scipy.spatial
import shapely
import torch

from orbiflow.errors import CertificationError
from orbiflow.tiles import CLASSES, TileModel, certify
from orbiflow.tiles.flowing import tile_model
from orbiflow.tiles.flowing.tile_model import converge, extract_tile
from orbiflow.tiles.search.candidates import SAMPLE_COUNTS, TOLERANCES
from refusals import refused
from strategies import divided_start, error_estimate


def bent(name: str, rms: float = 0.15, seed: int = 0) -> TileModel:
    """A turned candidate whose fields have the given root mean square."""
    model = TileModel(CLASSES[name], torch.tensor([0.7]), max_frequency=2, smoothness=0.0)
    rng = np.random.default_rng(seed)
    with torch.no_grad():
        for field in model.flow.parameters():
            values = torch.tensor(rng.normal(size=field.shape))
            field.copy_(rms * values / values.norm())
    return model


def crossed() -> TileModel:
    """A candidate whose template crosses itself."""
    model = TileModel(CLASSES["IH21"], torch.tensor([0.7]), max_frequency=1)
    with torch.no_grad():
        model.shape.add_(2.0)
    return model


def test_converge_doubles_until_accurate() -> None:
    model = bent("IH4")
    points = divided_start(model, 4)
    model.flow = model.flow.with_steps(2)
    _, error = converge(model, points, tolerance=1e-7)
    assert error <= 1e-7
    chosen = model.flow.steps
    with torch.no_grad():
        moved = model.flow(points)
        exact = model.flow.with_steps(16 * chosen)(points)
    assert (moved - exact).norm(dim=-1).max().item() <= 1e-7
    # no finer than need be: an eighth of the steps is too coarse
    assert error_estimate(model.flow.with_steps(max(1, chosen // 8)), points) > 1e-7


def test_converge_gives_up_on_a_steep_field() -> None:
    model = bent("IH1", rms=3000.0)
    model.flow = model.flow.with_steps(512, method="euler")
    with refused("1024 steps", "max-frequency", kind=CertificationError):
        converge(model, divided_start(model, 1))


def test_converge_refuses_a_field_that_is_not_finite() -> None:
    model = bent("IH1")
    with torch.no_grad():
        next(model.flow.parameters()).fill_(float("nan"))
    steps = model.flow.steps
    with refused("learning rate", kind=CertificationError):
        converge(model, divided_start(model, 1))
    assert model.flow.steps == steps
    for force in (False, True):
        with refused("finite", kind=CertificationError):
            extract_tile(model, force=force)


@pytest.mark.parametrize("name", CLASSES)
def test_polygon_follows_the_curve(name: str) -> None:
    model = bent(name)
    settings_before = (model.flow.steps, model.flow.method)
    tile, fine = extract_tile(model)
    assert (model.flow.steps, model.flow.method) == settings_before
    kind = CLASSES[name]
    with torch.no_grad():
        pieces = 2 * -(-SAMPLE_COUNTS[0] // (2 * len(kind.template())))
        curve = fine(divided_start(fine, pieces))[0].numpy()
    assert tile.isohedral_class == name
    assert len(tile.corners) == len(kind.template())
    assert np.allclose(tile.polygon[list(tile.corners)], curve[::pieces], atol=1e-12)
    nearest = np.asarray(scipy.spatial.KDTree(curve).query(tile.polygon)[0])
    assert nearest.max() < 1e-12
    ring = shapely.Polygon(tile.polygon).exterior
    # the model has area 1, so tolerances are lengths; a partner edge is no worse
    assert shapely.distance(shapely.points(curve), ring).max() <= TOLERANCES[0] * 1.001
    assert len(tile.polygon) < len(curve) / 2
    assert certify(tile).edge_matching == "segments"


def test_a_crossing_boundary_is_refused_unless_forced() -> None:
    with refused("IH21", kind=CertificationError):
        extract_tile(crossed())
    tile, _ = extract_tile(crossed(), force=True)
    assert len(tile.polygon) == SAMPLE_COUNTS[-1]
    certificate = certify(tile)
    assert not certificate.valid
    assert "not simple: self-intersection" in certificate.reasons[0]


def test_force_takes_an_inaccurate_flow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tile_model, "MAX_STEPS", 8)
    with refused("16 steps", kind=CertificationError):
        extract_tile(bent("IH3"))
    # edges match at any number of steps (design point 5)
    assert certify(extract_tile(bent("IH3"), force=True)[0]).edge_mismatch < 1e-12
