"""Faithfulness: any shape against a silhouette, wherever it lies and its limbs point."""

from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.tiles import faithfulness, plane_points
from orbiflow.tiles.likeness import any_shape, bending_onto
from outlines import animal, bent_squirrel
from refusals import refused

ALL_STARTS = bending_onto.STARTS
SQUIRREL = np.asarray(animal("squirrel.dat").normal)


@pytest.fixture(autouse=True, scope="module")
def _one_turn() -> Iterator[None]:
    """Of all rotations and both hands the best is refined, from one correspondence."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(any_shape, "REFINED_TURNS", 1)
        patch.setattr(bending_onto, "STARTS", bending_onto.STARTS[1:2])
        yield


@settings(max_examples=4, deadline=None)  # half a second each: both hands, every turn
@given(st.floats(0.1, 10), st.floats(-3.2, 3.2), st.booleans(), st.integers(0, len(SQUIRREL) - 1))
def test_motions_mirrors_and_scale_cost_nothing(scale, turn, mirrored, first) -> None:
    z = np.roll(SQUIRREL, first, axis=0) @ [1, 1j] * scale * np.exp(1j * turn) + 3
    found = faithfulness(SQUIRREL, plane_points(np.conj(z) if mirrored else z))
    assert found.score > 0.995


def test_a_mirror_image_may_be_asked_to_count() -> None:
    flipped = SQUIRREL * (-1, 1)
    assert faithfulness(SQUIRREL, flipped, mirror=False).score < 0.9


@pytest.mark.parametrize("name", ["IH4", "IH28"])
def test_a_tile_is_judged_as_by_the_points_that_it_was_bent_by(name: str, monkeypatch) -> None:
    monkeypatch.setattr(bending_onto, "STARTS", ALL_STARTS)
    case = bent_squirrel(name, False)
    known = case.bent.fidelity
    found = faithfulness(SQUIRREL, case.tile.polygon)
    # by least bending points lie elsewhere than by the highest mark: at times better, mostly worse
    assert known.mark - 0.8 < found.mark < known.mark + 0.5


def test_mistakes_are_named() -> None:
    bow = [[0, 0], [1, 1], [1, 0], [0, 1]]
    with refused("shape", "[0.5 0.5]"):
        faithfulness(SQUIRREL, bow)
    with refused("silhouette", "(2,)"):
        faithfulness([1.0, 2.0], SQUIRREL)
