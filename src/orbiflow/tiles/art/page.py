"""Which copies of the tile a picture shows, where, and in which colours."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.art.repeat import rectangle
from orbiflow.tiles.art.settings import ArtSettings, check_size
from orbiflow.tiles.exporting import longer_side
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import (
    Copies,
    Tile,
    colouring,
    copies_meeting,
)

USUAL = 25
"""Tiles on a page whose tiles' size is not asked for."""


@dataclass(frozen=True, eq=False)
class ArtPage:
    """A picture's tiles.

    - `width`, `height`: in pixels.
    - `tile`: in its own units.
    - `copies`: of it: all that the picture shows, and some beyond.
    - `linear`, `offset`: from there to pixels, y down.
    - `colours`: (M,) number of each copy's colour.
    - `count`: how many colours there are.
    - `tile_size`: in pixels.
    - `notes`: what the user should know.
    """

    width: int
    height: int
    tile: Tile
    copies: Copies
    linear: Array
    offset: Array
    colours: NDArray[np.int64]
    count: int
    tile_size: float
    notes: tuple[str, ...] = ()

    @property
    def scale(self) -> float:
        """Pixels a unit."""
        return float(np.sqrt(abs(np.linalg.det(self.linear))))

    @property
    def shown(self) -> float:
        """How many tiles the picture has room for, by area."""
        return self.width * self.height / (self.scale**2 * abs(self.tile.signed_area))

    def rings(self) -> Array:
        """(M, N, 2) the copies in pixels."""
        return self.copies.images(self.tile.polygon) @ self.linear.T + self.offset


class _Colours:
    """How the copies of a tile are coloured, and which translations keep the colours."""

    def __init__(self, tile: Tile, how: str) -> None:
        self.how = how
        order = tile.group.order
        self.count = {"one": 1, "aspect": order}.get(how, 0)
        self.lattice = tile.group.lattice
        if how == "neighbour":
            self.own = colouring(tile)
            self.count = self.own.count
            a, b, c = self.own.sublattice
            self.lattice = tile.group.lattice @ np.array([[a, b], [0.0, c]])

    def of(self, copies: Copies) -> NDArray[np.int64]:
        if self.how == "one":
            return np.zeros(len(copies), dtype=np.int64)
        return copies.cosets if self.how == "aspect" else self.own.colours(copies)


def art_page(given: EscherTile, settings: ArtSettings) -> ArtPage:
    """Put the tile on a page of the settings' size, the way up it has; or make the repeating cell.

    Raises:
        OrbiflowError: for more tiles than can be drawn, and where no rectangle repeats.
    """
    tile = given.tile
    colours = _Colours(tile, settings.colour)
    flip = np.diag([1.0, 1.0 if given.y_down else -1.0])
    size = longer_side(tile.polygon)
    scale = _scale(tile, settings) if settings.tile_size is None else settings.tile_size / size
    if not settings.repeat:
        linear, (width, height) = scale * flip, settings.size
        offset = np.array([width, height]) / 2 - linear @ tile.center
        return _page(tile, colours, linear, offset, (width, height), ())
    found = rectangle(colours.lattice, scale, settings.tolerance, flipped=not given.y_down)
    try:
        check_size(found.width, found.height)
    except OrbiflowError as error:
        raise OrbiflowError(f"the cell that repeats is too large: {error}") from error
    offset = np.array([found.width, found.height]) / 2 - found.linear @ tile.center
    tiles = found.width * found.height / (abs(tile.signed_area) * abs(np.linalg.det(found.linear)))
    said = f"the cell that repeats is {found.width} x {found.height} pixels and holds {tiles:.0f} tiles"
    if abs(found.turn) > 0.05:
        said += f"; the tiling is turned by {found.turn:.1f} degrees"
    said += "; " + _strain_said(found.strain, exact=found.exact)
    return _page(tile, colours, found.linear, offset, (found.width, found.height), (said,))


def laid(
    page: ArtPage, given: EscherTile, settings: ArtSettings, across: int, down: int
) -> ArtPage:
    """A page that shows a repeating cell's plane over `across` x `down` cells, made anew."""
    colours = _Colours(given.tile, settings.colour)
    size = page.width * across, page.height * down
    return _page(given.tile, colours, page.linear, page.offset, size, ())


def _strain_said(strain: float, *, exact: bool) -> str:
    if strain < 1e-9:
        return "nothing is stretched"
    share = f"{100 * strain:.2g} %" if strain >= 5e-5 else "less than 0.01 %"
    if exact:
        return f"whole pixels stretch it by {share}"
    return f"it is stretched by {share} to be a rectangle"


def _scale(tile: Tile, settings: ArtSettings) -> float:
    width, height = settings.size
    return float(np.sqrt(width * height / USUAL / abs(tile.signed_area)))


def _page(
    tile: Tile,
    colours: _Colours,
    linear: Array,
    offset: Array,
    size: tuple[int, int],
    notes: tuple[str, ...],
) -> ArtPage:
    width, height = size
    corners = np.array([[0.0, 0.0], [width, 0.0], [0.0, height], [width, height]])
    # a margin: outlines of tiles just beyond the edge reach in
    corners += np.sign(corners - 1) * 2.0
    there = (corners - offset) @ np.linalg.inv(linear).T
    copies = copies_meeting(tile, (*there.min(axis=0), *there.max(axis=0)))
    scale = float(np.sqrt(abs(np.linalg.det(linear))))
    return ArtPage(
        width,
        height,
        tile,
        copies,
        linear,
        offset,
        colours.of(copies),
        colours.count,
        scale * longer_side(tile.polygon),
        notes,
    )
