"""Animals to begin with, bundled with the package; animals/README.md says where they are from."""

from __future__ import annotations

from pathlib import Path

from orbiflow.studio.store import Missing

FOLDER = Path(__file__).parent / "animals"
ANIMALS = {
    "turtle": ("Turtle", ".png"),
    "night-monkey": ("Night monkey", ".png"),
    "barbet": ("Bird", ".svg"),
}
"""Titles and endings by name."""


def animal_file(name: str, *, picture: bool = False) -> Path:
    """Return the file of an animal; as a picture, one that every browser shows."""
    return FOLDER / f"{name}{'.png' if picture else _known(name)[1]}"


def animal_title(name: str) -> str:
    """Return what people call an animal."""
    return _known(name)[0]


def _known(name: str) -> tuple[str, str]:
    if name not in ANIMALS:
        raise Missing(f"there is no such animal; there are {', '.join(ANIMALS)}")
    return ANIMALS[name]
