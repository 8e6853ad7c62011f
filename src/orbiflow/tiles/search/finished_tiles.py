"""From candidates to finished tiles: polygons, measured and certified."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import zip_longest

import numpy as np
import shapely

from orbiflow.arrays import Array
from orbiflow.errors import Advice, CertificationError, OrbiflowError
from orbiflow.runtime import one_blas_thread, one_thread
from orbiflow.settings import as_instance
from orbiflow.tiles.likeness import (
    Likeness,
    Pinned,
    Rating,
    Recogniser,
    compare,
    fidelity_to_original,
    iou,
    narrowest_neck,
)
from orbiflow.tiles.search.bending import PlacedBent
from orbiflow.tiles.search.bent_map import map_of_bent
from orbiflow.tiles.search.candidates import ClassCandidates, ClassFinalists
from orbiflow.tiles.silhouette import HOW_TO_GET_A_TARGET, Target, is_mere_line, left_out_share
from orbiflow.tiles.tile import EscherTile, SearchFacts
from orbiflow.tiles.tile_map import TileMap
from orbiflow.tiles.tilings import Tile


@dataclass(frozen=True)
class ClassFailure:
    """A class that gave no certified tile, and why."""

    name: str
    reason: str


def best_tiles(
    target: Target,
    fit: ClassFinalists,
    *,
    force: bool = False,
    min_neck: float = 0.0,
    original: Target | None = None,
    smoothed: float = 0.0,
) -> list[EscherTile]:
    """Return certified polygons of finalists, best score first, as soon as there are enough.

    They are rated by how much they are like the `original`, if the target is that with what is narrower
    than the share `smoothed` of its length rounded off.
    """
    original = original or target
    tiles: list[EscherTile] = []
    reasons: list[str] = []
    for index in range(fit.candidates.size):
        try:
            result = _result(target, fit, index, original, force=force)
            likeness = replace(result.likeness, min_neck=min_neck, smoothed=smoothed)
            result = result.changed(likeness=likeness)
            if not force:
                result.certificate.require()
            if bent := fit.candidates.bent(index):
                result = with_bent(target, result, bent, original)
            tiles.append(result)
        except CertificationError as error:
            reasons.append(str(error))
        if len(tiles) == fit.enough:
            break
    if not tiles:
        raise CertificationError("; ".join(dict.fromkeys(reasons)))
    tiles.sort(key=lambda r: (not r.certificate.valid, -r.score))
    dropped = fit.crossed + len(reasons)
    return [result.changed(search=replace(result.search, dropped=dropped)) for result in tiles]


def _result(
    target: Target, fit: ClassFinalists, index: int, original: Target, *, force: bool
) -> EscherTile:
    tile, flow = fit.candidates.finished(index, force=force)
    result = measured_tile(target, tile, flow, original)
    return result.changed(search=SearchFacts(starts=fit.starts))


def measured_tile(target: Target, tile: Tile, tile_map: TileMap, original: Target) -> EscherTile:
    """Return a tile in the target's normal form as a finished one, with its measures."""
    placed = tile.transformed(target.frame.linear, target.frame.offset)
    region, simple = _region(placed.polygon)
    return EscherTile(
        placed,
        y_down=target.y_down,
        silhouette=original.report(),
        map_source=replace(tile_map, frame=target.frame),
        normal=tile,
        likeness=Likeness(
            metrics=compare(region, original.outline),
            recognisability=recogniser(original)(region),
            thinnest=narrowest_neck(placed.polygon) if simple else None,
        ),
    )


def _region(ring: Array) -> tuple[shapely.Polygon, bool]:
    """Return the region that a ring covers, and whether it is simple: a forced one may not be."""
    shape = shapely.Polygon(ring)
    return (shape, True) if shape.is_valid else (shapely.make_valid(shape).buffer(0), False)


def with_bent(
    target: Target, result: EscherTile, placed: PlacedBent, original: Target
) -> EscherTile:
    """Return a finished tile with the silhouette that was bent to it, and the map from it."""
    rest, outline, ends = (target.frame.to_input(ring) for ring in placed.outlines)
    kept = replace(placed.bent.fidelity, cost=placed.bent.cost)
    if smoothed := result.likeness.smoothed:
        near = smoothed * float(np.ptp(original.normal, axis=0).max())
        rings = original.without_fur, original.to_normal(rest), original.to_normal(ends)
        kept = fidelity_to_original(*rings, near, kept.cost)
    tile, simple = _region(result.tile.polygon)
    body, maps, bending, no_map = placed.bent.orientation.fine, result.map, None, ""
    try:
        bending = map_of_bent(*placed, result.normal_tile)
    except OrbiflowError as error:  # hairs that no triangulation follows
        no_map = str(error)
    likeness = replace(
        result.likeness,
        rest=rest,
        bent=outline,
        bent_iou=iou(_region(outline)[0], tile) if simple else None,
        deformation=kept.cost,
        fidelity=kept,
        pinned=body.misfit(placed.bent.points[: body.size]) if isinstance(body, Pinned) else None,
    )
    return result.changed(
        likeness=likeness,
        search=replace(result.search, objective="likeness"),
        map_source=None if maps is None else replace(maps, bending=bending),
        no_map=no_map,
    )


@lru_cache(maxsize=2)  # targets hash by identity; one serves all tiles
def recogniser(target: Target) -> Recogniser:
    """Return the recogniser of the target's outline, in the input's own coordinates."""
    return Recogniser(target.outline)


def rated(tiles: Sequence[EscherTile], *targets: Target) -> list[EscherTile]:
    """Return the tiles of a run with their ratings, in the same order.

    That of a tile that figures divide is the worst one's. Where a reading left parts of a picture out,
    they count as lost.
    """
    return [_rated(tile, targets) for tile in tiles]


def _rated(tile: EscherTile, targets: Sequence[Target]) -> EscherTile:
    if len(tile.figures) > 1:
        figures = [
            part if target is None else part._replace(figure=_rated(part.figure, [target]))
            for part, target in zip_longest(tile.figures, targets)  # a background has none
        ]
        tile = tile.changed(division=tuple(figures))
        return tile.changed(rating=tile.worst.rating)
    if is_mere_line(targets[0]):
        return tile.changed(rating=Rating(1))
    of_score = Rating.of_likeness if tile.likeness.fidelity else Rating.of_overlap
    rating = of_score(tile.score)
    # stars are of what the user brought: a tile lacks what the reading left out, too
    return tile.changed(rating=rating.of_share(1 - left_out_share(targets[0])))


POOR_SCORE = 0.4  # the score below which a note explains what makes the best likeness poor
LONG_OUTLINE_LENGTH = 8.5  # in square roots of the area: long thin limbs, such as a spider's


def why_poor(best: EscherTile) -> str:
    """Return why few people would find a run's best tile good, and what to try; "" if many would."""
    kept = best.worst.likeness.fidelity
    share = best.score if kept else 1.0
    if share >= POOR_SCORE and not (best.rating and best.rating.word == "poor"):
        return ""
    long = kept is not None and kept.length > LONG_OUTLINE_LENGTH
    reasons = ["a tile fills the empty space around long thin limbs"] * long
    reasons += kept.lost if kept else []
    because = f", because {' and because '.join(reasons[:2])}" if reasons else ""
    change = "thicker or shorter limbs" if long else "another pose, fewer or thicker limbs"
    return (
        f"few people would call the first tile a good likeness{because}; {change} or more effort may "
        "do better"
    )


def rounded_for(tiles: Sequence[EscherTile]) -> Advice:
    """Return which tiles are of the silhouette with thin parts rounded off; "" if none are."""
    shares: dict[float, list[str]] = {}
    for tile in tiles:
        if share := tile.worst.likeness.smoothed:
            shares.setdefault(share, []).append(tile.isohedral_class)
    lines = (
        f"no tile of {', '.join(dict.fromkeys(names))} has all of the silhouette's thin parts: what is "
        f"narrower than {100 * share:g} % of its length was rounded off first; "
        f"{{thicken}} {max(0.04, 2 * share):g} grows thin parts instead"
        for share, names in sorted(shares.items())
    )
    return Advice("; ".join(lines))


def certified_tiles(
    target: Target, found: ClassFinalists | ClassCandidates, *, force: bool = False
) -> list[EscherTile]:
    """Return polygons of what was fitted to a target, each proved to tile the plane, best first.

    Args:
        target: The silhouette.
        found: What `fit_tile` gave, or candidates, such as a `TileModel` trained further or loaded.
        force: Give tiles that are not certified, too; their certificates say why.

    Raises:
        OrbiflowError: for what holds no candidates.
        CertificationError: if none of them is certified and `force` is not set.
    """
    as_instance(target, Target, "the target", HOW_TO_GET_A_TARGET)
    if isinstance(found, ClassCandidates):
        found = ClassFinalists(found, found.size, 0, found.size)
    as_instance(
        found, ClassFinalists, "what was found", "fit_tile gives a Fit, load_model a TileModel"
    )
    with one_thread(), one_blas_thread():
        return best_tiles(target, found, force=force)
