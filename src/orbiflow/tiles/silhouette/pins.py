"""Pins, the parts of a silhouette that must not bend, given as spots or painted on a mask."""

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self, cast

import numpy as np
import scipy.ndimage
import scipy.sparse
import scipy.sparse.csgraph
import shapely
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.settings import as_array, as_instance, as_number
from orbiflow.tiles.geometry import resampled
from orbiflow.tiles.silhouette.emphasis import Emphasis
from orbiflow.tiles.silhouette.outlines import outside, percent
from orbiflow.tiles.silhouette.target import Target

DEFAULT_RADIUS = 0.08  # default radius of a spot, in longer sides of the silhouette's bounding box
# the shares of the outline beyond which the tile cannot be similar, and nothing is left to bend
MUCH_PINNED_SHARE, MAX_PINNED_SHARE = 0.4, 0.9
REACH_PAST_OUTLINE = 1.5  # the reach of a spot without a radius, in distances from the outline
PAINTED_LEVEL = 0.1  # of a mask with soft edges: what is above this was painted
_NUMBER = r"\s*[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?\s*"
_SPOT = re.compile(rf"{_NUMBER}(?:,{_NUMBER}){{1,2}}")


@dataclass(frozen=True, eq=False)
class Pins:
    """Parts of a silhouette that keep their shape.

    Create them with `Pins.read` or `Pins.at`.

    - `spots`: Discs (K, 3) in the target's normal form: x, y and radius.
    - `masks`: Masks; what is more than half emphasised is pinned.
    - `keep_angle`: Whether the parts rotate only with the whole tile.
    - `sources`: The spots and masks as given, for reports.
    - `notes`: What was decided for the user, in plain words.

    >>> target = Target.from_polygon([[0, 0], [4, 0], [4, 1], [0, 1]])
    >>> pins = Pins.at(target, [(3.5, 0.5, 1.0)])
    >>> pins.holds(target.to_normal([[3.8, 0.1], [1.0, 0.5]]))
    array([ True, False])
    """

    spots: Array
    masks: tuple[Emphasis, ...] = ()
    keep_angle: bool = False
    sources: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @classmethod
    def at(cls, target: Target, spots: Iterable[ArrayLike], *, keep_angle: bool = False) -> Self:
        """Return pins at spots (x, y) or (x, y, radius), all in the input's units.

        The default radius of a spot is 8% of the longer side of the silhouette's bounding box, or
        1.5 times its distance from the outline if that is more, so that it holds some of the
        outline.

        Raises `OrbiflowError` for an invalid spot, a radius that is not positive, a spot that does
        not reach the silhouette, no spot, and spots that hold nine tenths of the outline.
        """
        return cls._create(target, list(spots), (), keep_angle)

    @classmethod
    def read(cls, given: Iterable[str | Path], target: Target, *, keep_angle: bool = False) -> Self:
        """Return pins from text: spots "x,y" or "x,y,radius", or paths of masks, white where pinned.

        A mask covers the same as in `Emphasis.read`: the picture, the drawing's page, or the
        outline's bounding box.

        Raises:
            InputFileError: for masks that cannot be read or do not touch the silhouette.
            OrbiflowError: as for `at`.
        """
        words = [str(pin) for pin in given]
        spots = [word for word in words if _SPOT.fullmatch(word)]
        files = [word for word in words if not _SPOT.fullmatch(word)]
        for file in files:
            if not Path(file).exists():
                raise InputFileError(
                    f"{file}: there is no such file; give a pin as x,y or x,y,radius or a mask's path"
                )
        masks = tuple(Emphasis.read(file, target) for file in files)
        discs = [[float(part) for part in spot.split(",")] for spot in spots]
        return cls._create(target, discs, masks, keep_angle)

    @classmethod
    def _create(
        cls,
        target: Target,
        spots: list[ArrayLike] | list[list[float]],
        masks: tuple[Emphasis, ...],
        keep_angle: bool,
    ) -> Self:
        as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
        discs = [_disc(spot, target) for spot in spots]
        if not discs and not masks:
            raise OrbiflowError("no pin was given: give a spot x,y or x,y,radius, or a mask")
        scale = np.sqrt(target.area)
        placed = [(*target.to_normal(disc[:2]), disc[2] / scale) for disc in discs]
        sources = [",".join(f"{value:.6g}" for value in disc) for disc in discs]
        sources += [mask.source for mask in masks]
        pins = cls(np.array(placed).reshape(-1, 3), masks, keep_angle, tuple(sources))
        notes = [note for mask in masks for note in mask.notes]
        return replace(pins, notes=(*notes, *_warnings(pins, target)))

    def holds(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Return which of the points (..., 2) of the normal form are pinned."""
        at = np.asarray(points, dtype=np.float64)
        held = np.zeros(at.shape[:-1], dtype=bool)
        for x, y, radius in self.spots:
            held |= np.hypot(at[..., 0] - x, at[..., 1] - y) <= radius
        for mask in self.masks:
            held |= 2 * (mask.weight(at) - 1) > mask.strength - 1
        return held

    @cached_property
    def middles(self) -> Array:
        """The middle (K, 2) of each spot, and of each piece that is painted."""
        painted = [_strongest(mask) for mask in self.masks]
        return np.concatenate([self.spots[:, :2], *painted])

    def parts(self, points: Array, triangles: Integers) -> list[Integers]:
        """Return the indices of a mesh's pinned points (N, 2), by parts that triangles connect.

        Where triangles are large, a pin may have none of their corners: it holds the triangle around
        its middle, in any case.
        """
        held = self.holds(points)
        held[triangles[_around(points, triangles, self.middles)]] = True
        pairs = np.concatenate([triangles[:, [k - 1, k]] for k in range(3)])
        pairs = pairs[held[pairs].all(axis=1)]
        shape = (len(held), len(held))
        links = scipy.sparse.coo_matrix((np.ones(len(pairs)), pairs.T), shape=shape)
        _, label = scipy.sparse.csgraph.connected_components(links, directed=False)
        return [np.flatnonzero((label == k) & held) for k in np.unique(label[held])]

    def report(self) -> dict[str, Any]:
        """Return the pins' settings, ready for JSON."""
        return {
            "sources": list(self.sources),
            "keep_angle": self.keep_angle,
            "notes": list(self.notes),
        }


def _warnings(pins: Pins, target: Target) -> list[str]:
    """Return notes of how much of the outline is held; an error where that is all of it."""
    share = float(pins.holds(resampled(target.normal, 720)).mean())
    if share >= MAX_PINNED_SHARE:
        raise OrbiflowError(
            f"what keeps its shape is {percent(share)} of the outline, so that nothing is left to "
            "bend; pin less, such as a head or a hand"
        )
    if share > MUCH_PINNED_SHARE:
        return [f"the pins hold {percent(share)} of the outline: little is left to bend"]
    if not share:
        return [
            "the pins lie inside: what they hold keeps its shape there, and the outline may bend"
        ]
    return []


def _strongest(mask: Emphasis) -> Array:
    """Return the strongest point (K, 2) of each piece that is painted on a mask."""
    pieces, count = cast(Any, scipy.ndimage.label(mask.mask > PAINTED_LEVEL))
    positions = scipy.ndimage.maximum_position(mask.mask, pieces, range(1, count + 1))
    xmin, ymin, xmax, ymax = mask.box
    shares = (np.reshape(positions, (-1, 2))[:, ::-1] + 0.5) / mask.mask.shape[::-1]
    return np.array([xmin, ymax]) + shares * (xmax - xmin, ymin - ymax)


def _around(points: Array, triangles: Integers, middles: Array) -> Integers:
    """Return which triangles (M,) of a mesh have one of the `middles` (K, 2) in them."""
    corners = cast(NDArray[np.object_], shapely.polygons(points[triangles]))
    pairs = shapely.STRtree(corners).query(shapely.points(middles), predicate="intersects")
    return np.unique(pairs[1])


def _disc(spot: ArrayLike, target: Target) -> tuple[float, float, float]:
    """Return a spot as x, y and radius in input units."""
    values = as_array(spot, "a pin", ("2 or 3",))
    if len(values) not in (2, 3):
        raise OrbiflowError(f"a pin must be x,y or x,y,radius, got {len(values)} numbers")
    x, y = (float(value) for value in values[:2])
    region = shapely.Polygon(target.outline)
    centre = shapely.Point(x, y)
    radius = DEFAULT_RADIUS * float(np.ptp(target.outline, axis=0).max())
    if len(values) == 3:
        radius = as_number(values[2], "the radius of a pin", above=0)
    elif region.contains(centre):
        radius = max(radius, REACH_PAST_OUTLINE * centre.distance(region.exterior))
    if centre.distance(region) > radius:
        raise outside("the pin", x, y, region)
    return x, y, radius
