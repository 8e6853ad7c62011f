"""What makes searches in tests cheap."""

import pytest

from orbiflow.tiles.likeness import bending_onto


@pytest.fixture
def hasty_measure(monkeypatch: pytest.MonkeyPatch) -> None:
    """Deformations of tiles that were not found by bending are measured by a short descent."""
    monkeypatch.setattr(bending_onto, "STARTS", bending_onto.STARTS[1:2])
    monkeypatch.setattr(bending_onto, "ENERGY_STEPS", 3)
    monkeypatch.setattr(bending_onto, "SOFTENINGS", 1)
    monkeypatch.setattr(bending_onto, "STEPS_PER_SOFTENING", 1)
