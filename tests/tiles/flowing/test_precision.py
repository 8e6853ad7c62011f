"""Tiles stay certified whatever precision a model has been through."""

import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.tiles import CLASSES, TileModel, certify
from orbiflow.tiles.flowing.starts import template_starts
from orbiflow.tiles.flowing.tile_model import extract_tile
from strategies import divided_start, random_tensor, seeds

CASTS = {
    "float": lambda model: model.float(),
    "half": lambda model: model.half(),
    "bfloat16": lambda model: model.bfloat16(),
    "double": lambda model: model.double(),
    "to float32": lambda model: model.to(torch.float32),
    "to cpu": lambda model: model.to("cpu", torch.float64),
    "type": lambda model: model.type(torch.float32),
}
casts = st.lists(st.sampled_from(list(CASTS)), min_size=1, max_size=3)


def started(name: str, seed: int, *, from_template: bool) -> TileModel:
    """A bent candidate, started from the class's template or from a stretched polygon of it."""
    kind = CLASSES[name]
    starts = None if from_template else template_starts(kind, turns=2, stretch=0.2, vertices=60)
    model = TileModel(
        kind,
        torch.zeros(1) if starts is None else None,
        max_frequency=2,
        prototiles=None if starts is None else starts.take([len(starts) - 1]),
    )
    with torch.no_grad():
        for parameter in model.parameters():
            parameter.add_(0.01 * random_tensor(seed, *parameter.shape, size=1.0))
    return model


@settings(max_examples=20)
@given(st.sampled_from(list(CLASSES)), casts, seeds, st.booleans())
def test_no_cast_loses_the_certificate(
    name: str, steps: list[str], seed: int, from_template: bool
) -> None:
    model = started(name, seed, from_template=from_template)
    exact = None if model.vertices is None else model.vertices.clone()
    for step in steps:
        assert CASTS[step](model) is model
    tile, fine = extract_tile(model)
    certificate = certify(tile, tolerance=1e-9)
    assert certificate.valid, certificate.reasons
    assert certificate.edge_mismatch < 1e-12
    assert fine.angle.dtype == torch.float64
    if exact is not None:
        assert model.vertices is not None
        assert torch.equal(model.vertices, exact)


def test_a_rounded_model_still_maps_in_its_own_precision() -> None:
    model = started("IH6", 3, from_template=False).float()
    assert model.prototile()[0].dtype == torch.float32
    assert model(divided_start(model, 2)).dtype == torch.float32
    assert model.take([0]).vertices is not None
    assert model.take([0]).vertices.dtype == torch.float64  # pyright: ignore[reportOptionalMemberAccess]
