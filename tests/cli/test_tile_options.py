"""What the commands on a tile of a run have in common is the same in each."""

from __future__ import annotations

import re

import pytest

from orbiflow.drawing import PALETTES
from orbiflow.runtime import find

COMMANDS = ["art", "export", "animate", "solid"]


@pytest.mark.parametrize("command", COMMANDS[:3])
def test_the_help_names_every_palette(command: str, orbiflow) -> None:
    outcome = orbiflow(command, "--help")
    assert outcome.status == 0
    assert set(PALETTES) <= set(re.findall(r"[a-z-]+", outcome.out))


@pytest.mark.parametrize("option", ["result", "tile", "force"])
def test_shared_options_are_one(option: str) -> None:
    found = [
        next(entry for entry in find(command).fields if entry.name == option)
        for command in COMMANDS
    ]
    assert all(entry == found[0] and entry.doc == found[0].doc for entry in found)
