"""Tiles by a loss of one's own: whatever the loss asks for, what comes out tiles."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError
from orbiflow.runtime import Cancel, Cancelled
from orbiflow.symmetry import CrystallographicGroup, wallpaper_group
from orbiflow.tiles import CLASSES, EscherTile, Tile, certify, dirichlet_tile, refine
from orbiflow.tiles.search import TileVariations
from refusals import refused
from strategies import seeds, wallpaper_groups

HEXAGON = 2 * math.sqrt(2 * math.sqrt(3))  # perimeter of the regular one of area 1


def perimeter(polygon: Tensor) -> Tensor:
    return (polygon - polygon.roll(1, 0)).norm(dim=1).sum()


def template(name: str) -> Tile:
    kind = CLASSES[name]
    return Tile(kind.template(), kind.group(), name, tuple(range(len(kind.template()))))


def any_cell(group: CrystallographicGroup, seed: int) -> Tile:
    """A Dirichlet cell of the group; about a centre or on a mirror it has symmetries of its own."""
    share = np.random.default_rng(seed).integers(0, 13, 2) / 12
    return dirichlet_tile(group, group.lattice @ share)


@given(wallpaper_groups(), seeds)
def test_every_simple_polygon_of_the_space_tiles(group: CrystallographicGroup, seed: int) -> None:
    tile = any_cell(group, seed)
    space = TileVariations(tile)
    assert np.abs(space.polygon(space.start) - tile.polygon).max() < 1e-9 * tile.radius
    rng = np.random.default_rng(seed)
    moved = space.start + 0.02 * tile.radius * rng.normal(size=len(space.start))
    found = space.tile(moved)
    certificate = certify(found)
    assert certificate.valid == certificate.simple
    assert found.signed_area == pytest.approx(tile.signed_area, rel=1e-12)


@settings(max_examples=4)
@given(wallpaper_groups(), seeds, st.floats(-3, 3))
def test_no_loss_makes_a_fold(group: CrystallographicGroup, seed: int, size: float) -> None:
    tile = any_cell(group, seed)
    draw = torch.Generator().manual_seed(seed % 2**31)
    waves, phases = torch.randn(2, 6, generator=draw).double(), torch.randn(6, generator=draw)

    seen: list[float] = []

    def wild(polygon: Tensor) -> Tensor:
        """Pulls the outline to and fro, and makes it long or short."""
        local = (polygon - torch.tensor(tile.center)) / tile.radius
        value = torch.sin(4 * local @ waves + phases).sum() + size * perimeter(local)
        seen.append(float(value.detach()))
        return value

    found = refine(tile, wild, points=40, steps=12)
    assert found.certificate.valid
    assert found.certificate.edge_matching == "segments"
    assert float(wild(torch.tensor(found.tile.polygon))) <= seen[0] + 1e-6
    assert found.tile.signed_area == pytest.approx(tile.signed_area, rel=1e-9)


@pytest.mark.parametrize("name", ["IH1", "IH4", "IH6"])
def test_the_shortest_outline_is_the_regular_hexagon(name: str) -> None:
    # the lattice has to change, and corners to move
    start = template(name)
    bent = TileVariations(start)
    moved = bent.start + 0.15 * np.sin(np.arange(len(bent.start)))
    found = refine(bent.tile(moved), perimeter, points=48)
    length = float(perimeter(torch.tensor(found.tile.polygon)))
    assert length / math.sqrt(abs(found.tile.signed_area)) == pytest.approx(HEXAGON, rel=1e-4)


def test_steps_that_would_cross_are_shortened() -> None:
    space = TileVariations(template("IH4"))
    start = space.tile(space.start + 0.1 * np.sin(np.arange(len(space.start))))
    found = refine(start, lambda polygon: -perimeter(polygon), points=12)
    assert found.certificate.valid
    assert "the outline would have touched itself" in found.notes[0]


def test_a_pull_keeps_the_tile_near() -> None:
    start = TileVariations(template("IH4"))
    tile = start.tile(start.start + 0.1 * np.sin(np.arange(len(start.start))))
    away: list[float] = []
    for pull in (0.0, 10.0, 1000.0):
        found = refine(tile, perimeter, pull=pull, points=24, steps=40).tile
        away.append(float(np.linalg.norm(found.polygon - _vertices(tile, 24), axis=1).mean()))
    assert away[0] > 1.5 * away[1] > 15 * away[2]


def _vertices(tile: Tile, points: int) -> Array:
    """The vertices as `refine` divides the sides, before it moves any."""
    return refine(tile, lambda polygon: 0 * polygon.sum(), points=points).tile.polygon


def test_a_mirror_of_the_tile_stays() -> None:
    group = wallpaper_group("p4m")
    cell = dirichlet_tile(group, (0.0, 0.0))
    found = refine(cell, lambda polygon: polygon[:, 0].square().mean(), points=32)
    assert found.tile.tiling.stabilisers[0].order == 8


def test_what_is_kept_and_said() -> None:
    start = EscherTile(template("IH4"), name="mine", y_down=True)
    found = refine(start, lambda p: p[:, 0].square().mean(), steps=3)
    assert (found.name, found.y_down, found.isohedral_class) == ("mine", True, "IH4")
    assert "lowered from" in found.notes[0]
    assert "in 3 steps" in found.notes[0]
    corners = found.tile.polygon[list(found.tile.corners)]
    assert len(corners) == 6
    with refused("mine"):
        found.require_map()


def test_it_can_be_cancelled() -> None:
    cancel = Cancel()
    cancel.cancel()
    with pytest.raises(Cancelled):
        refine(template("IH4"), perimeter, cancel=cancel)


@pytest.mark.parametrize(
    "change",
    [
        *({"loss": 3}, {"loss": lambda p: p}, {"loss": lambda p: float(p.detach().sum())}),
        *({"loss": lambda p: p.detach().sum()}, {"loss": lambda p: p.sum() / 0}),
        *({"pull": -1}, {"steps": 0}, {"points": 2001}),
    ],
)
def test_mistakes_are_told(change) -> None:
    with refused(*change):
        refine(**{"tile": template("IH4"), "loss": perimeter, **change})


def test_what_does_not_tile_is_refused() -> None:
    square = Tile(
        np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), wallpaper_group("p1", [[2, 0], [0, 1]])
    )
    with refused("tile", kind=CertificationError):
        refine(square, perimeter)
