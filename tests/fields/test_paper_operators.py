"""The paper's nested operators are the mean over cosets up to a constant; its affine map is not."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.fields import periodic_operator, summed_over_powers, symmetrize
from orbiflow.symmetry import IDENTIFICATION_SPACES, CrystallographicGroup, identification_group
from orbiflow.tiles import CLASSES
from strategies import random_field, random_tensor, seeds

UNIT_CELL = CrystallographicGroup.generate(np.eye(2))

# terms of the paper's nested sums = factor between them and the mean over cosets
TERMS = {
    **{"IH1": 1, "IH2": 2 * 2, "IH3": 2 * 2, "IH4": 2 * 2 * 2 * 2, "IH5": 2 * 2 * 2 * 2},
    **{"IH6": 2 * 2 * 2 * 2, "IH7": 3, "IH21": 3 * 6, "IH28": 4 * 4, "torus": 1, "sphere": 4},
    **{"klein-bottle": 2, "projective-plane": 2 * 2},
}


def group_and_operators(name):
    """The group, and the paper's operators as (isometry, number of terms), outermost first."""
    if name in CLASSES:
        return CLASSES[name].group(), CLASSES[name].paper_operators()
    orders = {"sphere": 4}
    generators = IDENTIFICATION_SPACES[name].generators
    return identification_group(name), [(g, orders.get(name, 2)) for g in generators]


def nested(field, name):
    """The field of the paper's table: its operators around P_B(F), innermost last."""
    group, operators = group_and_operators(name)
    result = periodic_operator(field, group.lattice)
    for g, terms in reversed(list(operators)):
        result = summed_over_powers(result, g, terms)
    return result


@pytest.mark.parametrize("name", TERMS)
@settings(max_examples=4)
@given(seed=seeds, max_frequency=st.integers(1, 4))
def test_nested_sums_are_the_mean_over_cosets_times_their_number_of_terms(
    name, seed, max_frequency
):
    group, _ = group_and_operators(name)
    plain = random_field(UNIT_CELL, max_frequency, seed)
    points = random_tensor(seed, 10, 2)
    mean = symmetrize(periodic_operator(plain, group.lattice), group, periodic=True)
    torch.testing.assert_close(
        nested(plain, name)(points), TERMS[name] * mean(points), rtol=0, atol=2e-11
    )


@given(seeds, st.integers(0, 3))
def test_the_basis_operator_pushes_a_unit_periodic_field_to_the_lattice(seed, max_frequency):
    plain = random_field(UNIT_CELL, max_frequency, seed)
    lattice = np.array([[1.5, 0.2], [-0.3, 0.8]])
    p = random_tensor(seed, 5, 2)
    expected = plain(p @ torch.tensor(np.linalg.inv(lattice)).mT) @ torch.tensor(lattice).mT
    torch.testing.assert_close(periodic_operator(plain, lattice)(p), expected, rtol=0, atol=1e-12)
