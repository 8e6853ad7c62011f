"""Rotation centres and lines are what the group says they are."""

from __future__ import annotations

import numpy as np
import pytest

from orbiflow.errors import GroupError
from orbiflow.symmetry import (
    WALLPAPER_GROUPS,
    CrystallographicGroup,
    rotation,
    symmetry_elements,
    transflection,
    wallpaper_group,
)
from refusals import refused


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_every_element_found_is_in_the_group(name: str) -> None:
    group = wallpaper_group(name)
    found = symmetry_elements(group)
    for center in found.centers:
        assert group.contains(rotation(center.point, center.order), 1e-7)
        for higher in (2 * center.order, 3 * center.order):
            assert not group.contains(rotation(center.point, higher), 1e-7)
    for line in found.lines:
        assert group.contains(transflection(line.line, line.shift), 1e-7)
        assert line.is_mirror == (line.shift == 0.0)


ORDERS = {"p2": {2}, "pmm": {2}, "pmg": {2}, "pgg": {2}, "cmm": {2}}
ORDERS |= {name: {2, 4} for name in ("p4", "p4m", "p4g")}
ORDERS |= {name: {3} for name in ("p3", "p3m1", "p31m")}
ORDERS |= {name: {2, 3, 6} for name in ("p6", "p6m")}


@pytest.mark.parametrize("name", WALLPAPER_GROUPS)
def test_kinds(name: str) -> None:
    found = symmetry_elements(wallpaper_group(name))
    assert {center.order for center in found.centers} == ORDERS.get(name, set())
    mirrors = {line.is_mirror for line in found.lines}
    assert (True in mirrors) == (
        name in {"pm", "cm", "pmm", "pmg", "cmm"} or "m" in name[2:] or name == "p4g"
    )
    assert (False in mirrors) == (
        name in {"pg", "cm", "pmg", "pgg", "cmm", "p4m", "p4g", "p3m1", "p31m", "p6m"}
    )


def test_a_disc_of_p4() -> None:
    found = symmetry_elements(wallpaper_group("p4"), np.array([0.5, 0.5]), 0.75)
    assert sorted(center.order for center in found.centers) == [2] * 4 + [4] * 5


def test_needs_a_plane_group() -> None:
    with refused("dimension", 3, kind=GroupError):
        symmetry_elements(CrystallographicGroup.generate(np.eye(3)))
