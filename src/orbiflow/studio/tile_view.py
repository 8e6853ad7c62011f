"""What a browser needs of a tile, as JSON."""

from __future__ import annotations

from typing import Any

from orbiflow.arrays import Array
from orbiflow.runtime import is_list
from orbiflow.tiles import EscherTile, Rating, as_tiling, colouring


def tile_card(
    tile: EscherTile, number: int, stage: str, parent: int | None = None
) -> dict[str, Any]:
    """Return what a list of tiles shows: its tiling, stars and words.

    Args:
        tile: A certified tile.
        number: Its number in the studio.
        stage: How far its search is: sketch, better, final; or pulled.
        parent: The number of the tile that it was made from by hand.
    """
    rating = tile.rating or Rating(1)
    tiling, colours = as_tiling(tile.tile), colouring(tile.tile)
    return {
        "id": number,
        "class_name": tile.isohedral_class,
        "stage": stage,
        "stars": rating.stars,
        "word": rating.word,
        "score": tile.score if tile.score == tile.score else 0.0,
        "arrangement": tile.arrangement,
        "certified": tile.certificate.valid,
        "parent": parent,
        "polygon": _rounded(tile.tile.polygon),
        "y_down": tile.y_down,
        "group": {
            "name": tile.group_name,
            "lattice": tile.tile.group.lattice.tolist(),
            "cosets": [
                {"linear": coset.linear.tolist(), "translation": coset.translation.tolist()}
                for coset in (tile.tile.group.cosets[k] for k in tiling.aspects.cosets)
            ],
        },
        "colours": {"sublattice": list(colours.sublattice), "table": colours.table.tolist()},
    }


def _rounded(ring: Array) -> list[list[float]]:
    """Return points with as many digits as show."""
    size = float(abs(ring).max()) or 1.0
    points: list[list[float]] = ring.tolist()
    assert is_list(points)
    return [[float(f"{value / size:.6f}") * size for value in point] for point in points]


def tile_view(card: dict[str, Any], tile: EscherTile) -> dict[str, Any]:
    """Return what the page of one tile shows: its card and more."""
    del tile
    return card
