"""What an escherization gives: the tile, how good it is, and the proof that it tiles."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass, replace
from functools import lru_cache

import shapely

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.tiles.likeness import (
    Fidelity,
    Pinned,
    Recognisability,
    Recogniser,
    ShapeMetrics,
    Thinnest,
    compare,
    iou,
    narrowest_neck,
    neck_factor,
    rank_score,
)
from orbiflow.tiles.search.bending_fit import PlacedBent
from orbiflow.tiles.search.boundary import extract_tile
from orbiflow.tiles.search.carried import Bending
from orbiflow.tiles.search.fit import Fit
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.storage import SavedModel
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tilings import (
    Certificate,
    Tile,
    certify,
)


@dataclass(frozen=True, eq=False)
class TileResult:
    """The best tile of one isohedral class.

    - `name`: of the class, such as "IH4".
    - `group_name`: such as "p2".
    - `tile`: in the input's own coordinates.
    - `normal_tile`: in the target's normal form (y up, area 1, centroid 0).
    - `metrics`, `recognisability`: of the certified polygon against the target.
    - `certificate`: of `tile`, in the input's coordinates.
    - `model`: the diffeomorphism, into the target's normal form, and the input's frame.
    - `starts`, `dropped`: starts of the fit; those whose boundary crossed itself on the way, or that
      gave no certified tile.
    - `seconds`: of computing, on one core.
    - `thinnest`: the narrowest neck of `tile`.
    - `min_neck`: width in square roots of the area below which necks lower the score.
    - `objective`: what the fit was after, "likeness" or "overlap".
    - `bent`, `rest`: of a search for likeness, the bent silhouette near which the tile was found, and
      the silhouette as it is: outlines (n, 2) in the input's coordinates, point by point.
    - `bent_iou`: IoU of the tile with it.
    - `deformation`, `fidelity`: what bending the silhouette costs, and what is left of its outline
      (docs/likeness.md).
    - `pinned`: how far the worst pinned part's outline is from similar to what it was
      (`likeness.pinned.Pinned.misfit`); None without pins.
    - `front`: after a search for both, whether no tile that was found beats this one in both.
    - `others`: more tiles of the class, if they were asked for.
    """

    name: str
    group_name: str
    tile: Tile
    normal_tile: Tile
    metrics: ShapeMetrics
    recognisability: Recognisability
    certificate: Certificate
    model: SavedModel
    starts: int
    dropped: int
    seconds: float
    thinnest: Thinnest | None = None
    min_neck: float = 0.0
    objective: str = "overlap"
    fidelity: Fidelity | None = None
    bent: Array | None = None
    rest: Array | None = None
    bent_iou: float | None = None
    deformation: float | None = None
    pinned: float | None = None
    front: bool | None = None
    others: tuple[TileResult, ...] = ()

    @property
    def score(self) -> float:
        """What tiles are ranked by, 0 to 1: after a search for likeness its `fidelity`, else
        `rank_score` of IoU and recognisability; less in proportion where a neck is too thin.
        """
        if self.fidelity is not None:
            score = self.fidelity.score
        else:
            score = rank_score(self.metrics.iou, self.recognisability.score)
        if self.thinnest is None:
            return score
        return score * neck_factor(self.thinnest.share, self.min_neck)

    def family(self) -> tuple[TileResult, ...]:
        """This tile and the others of its class."""
        return (self, *self.others)


@dataclass(frozen=True)
class ClassFailure:
    """A class that gave no certified tile, and why."""

    name: str
    reason: str


def best_tiles(
    target: Target,
    fit: Fit,
    *,
    seconds: float = 0.0,
    force: bool = False,
    min_neck: float = 0.0,
) -> list[TileResult]:
    """Turn finalists into polygons and certify them, best first, until there are enough.

    Returns:
        Certified tiles, best score first.

    Raises:
        CertificationError: if no finalist is certified and `force` is not set.
    """
    found: list[TileResult] = []
    reasons: list[str] = []
    for index in range(fit.model.size):
        try:
            result = _result(target, fit.model.take([index]), fit.starts, seconds, force=force)
            result = replace(result, min_neck=min_neck)
            if not force:
                result.certificate.require()
            if fit.bent:
                result = _with_bent(target, result, fit.bent[index])
            found.append(result)
        except CertificationError as error:
            reasons.append(str(error))
        if len(found) == fit.enough:
            break
    if not found:
        raise CertificationError("; ".join(dict.fromkeys(reasons)))
    found.sort(key=lambda r: (not r.certificate.valid, -r.score))
    return [replace(result, dropped=fit.crossed + len(reasons)) for result in found]


def _result(
    target: Target, model: TileModel, starts: int, seconds: float, *, force: bool
) -> TileResult:
    tile, fine = extract_tile(model, force=force)
    placed = tile.transformed(target.frame.linear, target.frame.offset)
    # a forced tile may cross itself: measure the region that it covers
    shape = shapely.Polygon(placed.polygon)
    region = shape if shape.is_valid else shapely.make_valid(shape).buffer(0)
    return TileResult(
        name=model.isohedral_class.name,
        group_name=model.isohedral_class.group_name,
        tile=placed,
        normal_tile=tile,
        metrics=compare(region, target.outline),
        recognisability=recogniser(target)(region),
        certificate=certify(placed),
        model=SavedModel.of(fine, target.frame),
        starts=starts,
        dropped=0,
        seconds=seconds,
        thinnest=narrowest_neck(placed.polygon) if shape.is_valid else None,
    )


def _bending(placed: PlacedBent, tile: Tile) -> Bending | None:
    with contextlib.suppress(OrbiflowError):  # hairs that no triangulation follows
        return Bending.from_bent(placed.bent, placed.factor, placed.shift, tile)
    return None


def _with_bent(target: Target, result: TileResult, placed: PlacedBent) -> TileResult:
    rest, outline = (target.frame.to_input(ring) for ring in placed.outlines)
    region = shapely.Polygon(outline)
    whole = region if region.is_valid else shapely.make_valid(region).buffer(0)
    tile = shapely.Polygon(result.tile.polygon)
    body = placed.bent.hand.fine
    outline_points = placed.bent.points[: body.size]
    return replace(
        result,
        objective="likeness",
        rest=rest,
        bent=outline,
        bent_iou=iou(whole, tile) if tile.is_valid else None,
        deformation=placed.bent.fidelity.cost,
        fidelity=placed.bent.fidelity,
        pinned=body.misfit(outline_points) if isinstance(body, Pinned) else None,
        model=replace(result.model, bending=_bending(placed, result.normal_tile)),
    )


@lru_cache(maxsize=2)  # targets hash by identity; one serves all tiles
def recogniser(target: Target) -> Recogniser:
    """Of the target's outline in the input's own coordinates."""
    return Recogniser(target.outline)
