"""What a browser needs of a tile, as JSON."""

from __future__ import annotations

from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import cell_ring
from orbiflow.symmetry import CrystallographicGroup, symmetry_elements
from orbiflow.tiles import (
    EscherTile,
    Rating,
    border,
    colouring,
    narrowest_neck,
    polygon_json,
    tiling_json,
)


def tile_card(tile: EscherTile, number: int, stage: str) -> dict[str, Any]:
    """Return what a list of tiles shows: its tiling, stars and words.

    A tile that figures divide has `figures`, each with its name, stars, polygon and neck, where they
    lie in the tile; and in its `group` the number of the figure of each aspect.

    Args:
        tile: A certified tile.
        number: Its number in the studio.
        stage: How far its search is: sketch, better, final.
    """
    shown = tiling_json(tile.tiling, colouring(tile.tiling), y_down=tile.y_down)
    shown["group"]["name"] = tile.group_name
    card = {
        "id": number,
        "class_name": tile.isohedral_class,
        "stage": stage,
        **_rated(tile.rating),
        "score": tile.score if tile.score == tile.score else 0.0,
        "arrangement": tile.arrangement,
        "certified": tile.certificate.valid,
        "parent": None,
        **shown,
        **_outline(tile.tile.polygon),
    }
    if len(tile.figures) > 1:
        card["figures"] = [
            {
                "name": part.figure.name,
                "stars": _rated(part.figure.rating or tile.rating)["stars"],
                **_outline(part.prototile.polygon),
            }
            for part in tile.figures
        ]
    return card


def _rated(rating: Rating | None) -> dict[str, Any]:
    """Return the stars and the word of a rating; none for a tile that is like no picture."""
    return {"stars": rating.stars if rating else 0, "word": rating.word if rating else ""}


def _outline(ring: Array) -> dict[str, Any]:
    """Return a polygon with as many digits as show, and the ends of its neck."""
    return {"polygon": polygon_json(ring), "neck": narrowest_neck(ring).ends.tolist()}


def tile_view(card: dict[str, Any], tile: EscherTile) -> dict[str, Any]:
    """Return what the page of one tile shows: its card, `elements`, and each figure's `figure_view`.

    `elements` is what the group's symmetries are, one of each kind up to the lattice, in the input's
    units: the corners of a `cell`, `centres` with their order, `mirrors` and `glides` with a point and
    a direction. `notes` are sentences on how the tile was made.
    """
    figures = [part.figure for part in tile.figures]
    said = [note for figure in figures for note in (*figure.notes, figure.no_map) if note]
    view = {
        **card,
        "notes": list(dict.fromkeys([*tile.notes, *said])),
        "elements": elements_json(tile.tile.group, tile.tile.center),
    }
    if len(tile.figures) == 1:
        return {**view, **figure_view(tile, 0)}
    shown = [{**entry, **figure_view(tile, k)} for k, entry in enumerate(card["figures"])]
    return {**view, "figures": shown}


def figure_view(tile: EscherTile, number: int) -> dict[str, Any]:
    """Return what is shown of a tile's figure, in the tile's coordinates but where it says otherwise:

    - `silhouette_track`, `tile_track`: The silhouette's outline and where its points go; both are the
      figure's polygon where there is no map.
    - `map`: The triangles of the map, whose points `rest` are in the silhouette's own coordinates, or
      None; then `no_map` says why, if that is known.
    - `covered`: The corners, least and greatest, of what the silhouette's picture covers, in its own.
    - `y_down`: Whether y points down in these.
    - `place`: Where these lie, as a matrix for a canvas.
    """
    figure, place = tile.figures[number]
    bending, frame = figure.bending, figure.frame
    outline = place(figure.tile.polygon).tolist()
    view: dict[str, Any] = {
        "silhouette_track": outline,
        "tile_track": outline,
        "map": None,
        "no_map": figure.no_map,
        "covered": None,
        "y_down": figure.y_down,
        "place": [*place.linear.T.ravel().tolist(), *place.offset.tolist()],
    }
    if bending is None or frame is None:
        return view
    rest, images = frame.to_input(bending.rest), place(frame.to_input(bending.images))
    ring, covered = border(bending.triangles), figure.covered
    return {
        **view,
        "silhouette_track": place(rest[ring]).tolist(),
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
    elements = symmetry_elements(group, ring.mean(axis=0))
    size = float(np.sqrt(group.cell_volume))
    centres: dict[tuple[int, ...], dict[str, Any]] = {}
    for center in elements.centers:
        share = (center.point - ring[0]) @ group.inverse_lattice.T
        key = (center.order, *(np.round(share * 1e4).astype(int) % 10_000).tolist())
        centres.setdefault(key, {"order": center.order, "at": center.point.tolist()})
    lines = [
        {"at": line.point.tolist(), "along": line.direction.tolist(), "shift": shift / size}
        for line, shift in elements.lines
    ]
    return {
        "cell": ring.tolist(),
        "centres": list(centres.values()),
        "mirrors": [line for line in lines if not line["shift"]],
        "glides": [line for line in lines if line["shift"]],
    }
