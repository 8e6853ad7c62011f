"""What the commands on a tile of a run have in common is the same in each."""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import get_type_hints

import pytest

from orbiflow.cli.animate import animate
from orbiflow.cli.art import art
from orbiflow.cli.export import export
from orbiflow.drawing import PALETTES

every_command = pytest.mark.parametrize("command", [art, export, animate])


@every_command
def test_the_help_names_every_palette(command: Callable[..., None], orbiflow) -> None:
    outcome = orbiflow(command.__name__, "--help")
    assert outcome.status == 0
    assert set(PALETTES) <= set(re.findall(r"[a-z-]+", outcome.out))


@every_command
@pytest.mark.parametrize("option", ["result", "tile", "palette"])
def test_shared_options_are_one(command: Callable[..., None], option: str) -> None:
    own, other = (get_type_hints(f, include_extras=True) for f in (command, export))
    assert own[option].__metadata__[0] is other[option].__metadata__[0]
