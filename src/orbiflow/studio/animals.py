"""Animals to begin with, bundled with the package; animals/README.md says where they are from."""

from __future__ import annotations

from pathlib import Path

from orbiflow.studio.store import Missing

FOLDER = Path(__file__).parent / "animals"
ANIMALS = {
    "turtle": "Turtle",
    "gecko": "Gecko",
    "frog": "Frog",
    "barbet": "Bird",
    "monkey": "Night monkey",
    "crocodile": "Crocodile",
    "potoroo": "Rat kangaroo",
    "shark": "Shark",
    "bat": "Bat",
    "paca": "Paca",
}
"""What people call each animal."""


def animal_file(name: str) -> Path:
    """Return the picture of an animal."""
    if name not in ANIMALS:
        raise Missing(f"there is no such animal; there are {', '.join(ANIMALS)}")
    return FOLDER / f"{name}.png"
