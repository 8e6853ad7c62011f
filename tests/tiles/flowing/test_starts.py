"""Which starting poses are really different."""

import math

import numpy as np
import pytest
import torch

from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import CLASSES, TileModel
from orbiflow.tiles.flowing.starts import initial_poses
from orbiflow.tiles.flowing.tile_model import extract_tile
from orbiflow.tiles.search import template_symmetries

# class: order of the rotations, whether there is a reflection
SYMMETRIES = {
    **{"IH1": (6, True), "IH2": (2, True), "IH3": (2, True), "IH4": (2, True), "IH5": (1, True)},
    **{"IH6": (1, True), "IH7": (3, True), "IH21": (1, False), "IH28": (1, True)},
}


def placed(name: str, angle: float, mirrored: bool) -> tuple[np.ndarray, CrystallographicGroup]:
    """Template and group of a start."""
    model = TileModel(
        CLASSES[name],
        torch.tensor([angle], dtype=torch.float64),
        mirrored=torch.tensor([mirrored]),
        max_frequency=1,
    )
    return model.place(model.template()).detach().numpy()[0], extract_tile(model)[0].group


def same_group(a: CrystallographicGroup, b: CrystallographicGroup) -> bool:
    """Equality as sets of isometries, from lattices and coset representatives alone."""
    change = np.linalg.solve(a.lattice, b.lattice)
    if abs(change - change.round()).max() > 1e-9 or abs(abs(np.linalg.det(change)) - 1) > 1e-9:
        return False

    def within(g, others) -> bool:
        for h in others:
            shift = np.linalg.solve(a.lattice, g.translation - h.translation)
            if abs(g.linear - h.linear).max() < 1e-9 and abs(shift - shift.round()).max() < 1e-9:
                return True
        return False

    return len(a.cosets) == len(b.cosets) and all(within(g, b.cosets) for g in a.cosets)


def same_start(a: tuple[np.ndarray, CrystallographicGroup], b) -> bool:
    """Whether two placed templates are the same polygon with the same group."""
    gaps = np.linalg.norm(a[0][:, None] - b[0][None], axis=-1)
    return bool(gaps.min(axis=1).max() < 1e-9) and same_group(a[1], b[1])


def matching_angles(name: str, mirrored: bool) -> list[float]:
    """All turns in [0, 2 pi) that bring a start back onto the upright one, by trying every corner."""
    upright = placed(name, 0.0, False)
    other, _ = placed(name, 0.0, mirrored)
    found = []
    for corner in upright[0]:  # the first corner must land on one of them
        turn = math.atan2(corner[1], corner[0]) - math.atan2(other[0][1], other[0][0])
        if same_start(placed(name, turn, mirrored), upright):
            found.append(turn % (2 * math.pi))
    return found


@pytest.mark.parametrize("name", CLASSES)
def test_symmetries(name: str) -> None:
    assert template_symmetries(CLASSES[name]) == SYMMETRIES[name]


@pytest.mark.parametrize("name", CLASSES)
def test_symmetries_by_trying_every_corner(name: str) -> None:
    order, mirrored = SYMMETRIES[name]
    turns = matching_angles(name, mirrored=False)
    step = 2 * math.pi / order
    assert len(turns) == order
    assert all(abs(t / step - round(t / step)) < 1e-9 for t in turns)
    assert len(matching_angles(name, mirrored=True)) == (order if mirrored else 0)


@pytest.mark.parametrize("turns", [1, 5, 12])
@pytest.mark.parametrize("name", CLASSES)
def test_poses_divide_the_range(name: str, turns: int) -> None:
    order, mirror_closed = SYMMETRIES[name]
    angles, mirrored = initial_poses(CLASSES[name], turns)
    assert angles.shape == mirrored.shape == ((1 if mirror_closed else 2) * turns,)
    assert mirrored.dtype == bool
    assert mirrored.any().item() is not mirror_closed
    for flag in {False, not mirror_closed}:
        own = angles[mirrored == flag]
        gaps = np.diff(own, append=own[:1] + 2 * math.pi / order)
        np.testing.assert_allclose(gaps, 2 * math.pi / order / turns, atol=1e-12)
