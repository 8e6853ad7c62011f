"""The lattice freedom is the commutant of the point group."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.symmetry import WALLPAPER_GROUPS, CrystallographicGroup
from orbiflow.tiles import CLASSES
from orbiflow.tiles.tilings import commutant
from orbiflow.tiles.tilings.isohedral import stretch_matrix
from strategies import random_tensor, seeds, wallpaper_groups

DIMENSION = {"p1": 2, "p2": 2, "pm": 1, "pg": 1, "cm": 1, "pmm": 1, "pmg": 1, "pgg": 1, "cmm": 1}
"""Of the 17 groups; 0 where a rotation has order 3 or more."""


@pytest.mark.parametrize("name", CLASSES)
def test_the_nine_have_the_basis_that_saved_models_are_in(name: str) -> None:
    kind = CLASSES[name]
    units: Any = np.eye(2)[: DIMENSION.get(kind.group_name, 0)]
    assert np.array_equal(commutant(kind.group().linear_parts), units)
    assert kind.stretch_dim == len(units)


@given(st.data())
def test_dimension_and_commuting(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(list(WALLPAPER_GROUPS)))
    group: CrystallographicGroup = data.draw(wallpaper_groups([name]))
    basis = commutant(group.linear_parts)
    assert len(basis) == DIMENSION.get(name, 0)
    assert np.allclose(basis @ basis.T, np.eye(len(basis)), atol=1e-12)
    maps = stretch_matrix(basis, random_tensor(data.draw(seeds), 3, len(basis), size=1.0)).numpy()
    assert np.allclose(np.linalg.det(maps), 1)
    for linear in group.linear_parts:
        assert np.abs(linear @ maps - maps @ linear).max() < 1e-9
    stretched = group.conjugate(maps[0])
    assert stretched.order == group.order
