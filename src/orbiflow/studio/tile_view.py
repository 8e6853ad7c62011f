"""What a browser needs of a tile, as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import cell_ring
from orbiflow.symmetry import CrystallographicGroup, symmetry_elements
from orbiflow.tiles import EscherTile, Rating, as_tiling, border, colouring, narrowest_neck


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
    rating, neck = tile.rating or Rating(1), narrowest_neck(tile.tile.polygon)
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
        "neck": neck.ends.tolist(),
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
    return (np.round(ring / size, 6) * size).tolist()


def tile_view(card: dict[str, Any], tile: EscherTile) -> dict[str, Any]:
    """Return what the page of one tile shows: its card, and in the input's units:

    - `silhouette_track`, `tile_track`: The silhouette's outline and where its points go; both are the
      tile's polygon where there is no map.
    - `elements`: What the group's symmetries are, one of each kind up to the lattice: the corners of a
      `cell`, `centres` with their order, `mirrors` and `glides` with a point and a direction.
    - `map`: The triangles of the map from the silhouette, or None.
    - `covered`: The corners, least and greatest, of what the silhouette's picture covers.
    """
    bending, frame = tile.bending, tile.frame
    own = tile.tile.polygon.tolist()
    view: dict[str, Any] = {
        **card,
        "elements": elements_json(tile.tile.group, tile.tile.center),
        "silhouette_track": own,
        "tile_track": own,
        "map": None,
        "covered": None,
    }
    if bending is None or frame is None:
        return view
    rest, images = frame.to_input(bending.rest), frame.to_input(bending.images)
    ring, covered = border(bending.triangles), tile.covered
    return {
        **view,
        "silhouette_track": rest[ring].tolist(),
        "tile_track": images[ring].tolist(),
        "map": {
            "rest": rest.tolist(),
            "images": images.tolist(),
            "triangles": bending.triangles.tolist(),
        },
        "covered": [covered.low.tolist(), covered.high.tolist()],
    }


def elements_json(group: CrystallographicGroup, middle: Array) -> dict[str, Any]:
    """Return the symmetry elements of one lattice cell near `middle`."""
    ring = cell_ring(group, middle)[:-1]
    found = symmetry_elements(group, ring.mean(axis=0))
    size = float(np.sqrt(group.cell_volume))
    centres: dict[tuple[int, ...], dict[str, Any]] = {}
    for center in found.centers:
        share = (center.point - ring[0]) @ group.inverse_lattice.T
        key = (center.order, *(np.round(share * 1e4).astype(int) % 10_000).tolist())
        centres.setdefault(key, {"order": center.order, "at": center.point.tolist()})
    lines = [
        {"at": line.point.tolist(), "along": line.direction.tolist(), "shift": shift / size}
        for line, shift in found.lines
    ]
    return {
        "cell": ring.tolist(),
        "centres": list(centres.values()),
        "mirrors": [line for line in lines if not line["shift"]],
        "glides": [line for line in lines if line["shift"]],
    }
