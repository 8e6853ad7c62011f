"""Emphasis, a mask painted over the input picture that gives the plane's points weights."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import scipy
import shapely
from numpy.typing import ArrayLike, NDArray

from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.settings import as_array, as_instance, as_number
from orbiflow.tiles.silhouette.outlines import percent
from orbiflow.tiles.silhouette.readers import read_mask
from orbiflow.tiles.silhouette.target import Covered, Target

MAX_STRENGTH = 100.0
# In the normal form, where the silhouette has area 1. The mask's edges are smoothed over a few points
# of a tile's boundary, so that the force on it is continuous.
EDGE_SIGMA = 0.02  # standard deviation
FADE_WIDTH = 0.05  # beyond the mask's box
MAX_EDGE_SIGMA_PIXELS = 32.0  # pixels: a bound of the work
# of full emphasis: what is nowhere above this on the silhouette does not touch it
MIN_TOUCHING_LEVEL = 0.01
GRID_SIDE = 512  # pixels along a side of the grids that integrals are taken on


@dataclass(frozen=True, eq=False)
class Emphasis:
    """The weight 1 + (strength - 1) m of each point of the plane, with m from 0 to 1.

    Create one with `Emphasis.read`. All points are in the target's normal form (y up).

    - `mask`: The values m (H, W), 0 to 1, as float32, the picture's top row first; read-only.
    - `box`: The box (xmin, ymin, xmax, ymax) in the normal form that the mask's pixels cover.
    - `strength`: The weight of full emphasis, above 1 and at most 100.
    - `source`: The mask's file name, or a name for another source.
    - `share`: The mean of m over the silhouette, if it is known.
    - `notes`: What was decided for the user, in plain words.

    Raises `OrbiflowError` for a strength out of range and for an invalid mask or box.

    >>> emphasis = Emphasis(np.array([[1.0, 0.0], [0.0, 0.0]]), (-1, -1, 1, 1), strength=5.0)
    >>> emphasis.weight([[-0.5, 0.5], [0.0, 0.5], [0.5, -0.5], [9.0, 9.0]])
    array([5., 3., 1., 1.])
    """

    mask: NDArray[np.floating]
    box: Window
    strength: float = 4.0
    source: str = "mask"
    share: float | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        # without emphasis everything has weight 1
        as_number(self.strength, "strength of the emphasis", above=1, most=MAX_STRENGTH)
        mask = as_array(self.mask, self.source, (...,), finite=False).astype(np.float32)
        if mask.ndim != 2 or not mask.size or not (mask.min() >= 0 and mask.max() <= 1):
            raise OrbiflowError(
                f"{self.source}: a mask needs shape (H, W) and values from 0 to 1, got {mask.shape}"
            )
        xmin, ymin, xmax, ymax = as_array(self.box, f"{self.source}: the box", (4,), finite=False)
        if not (np.isfinite(self.box).all() and xmin < xmax and ymin < ymax):
            raise OrbiflowError(f"{self.source}: the box {self.box} has no area")
        mask.setflags(write=False)
        object.__setattr__(self, "mask", mask)

    @classmethod
    def read(cls, path: str | Path, target: Target, *, strength: float = 4.0) -> Self:
        """Read a mask (PNG, JPEG, WebP) painted over the picture that `target` was read from.

        White is fully emphasised and black not at all. If some of the mask is more transparent than
        the rest, opaque is emphasised, in any colour. The mask covers the picture of an image, the
        page (viewBox) of an SVG drawing, or else the outline's bounding box, and must have its
        aspect within 1%. Its edges are smoothed by 1/50 of the square root of the silhouette's
        area.

        Raises `InputFileError` for a file over 64 MB or 128 megapixels, one that is damaged or not
        an image, a mask of another aspect, a uniform mask, and one that emphasises no part of the
        silhouette; `OrbiflowError` for a strength that is not above 1 and at most 100.
        """
        as_instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
        path = Path(path)
        picture = read_mask(path)
        covered = target.covered
        covered.require_aspect(path, "mask", picture.size)
        size, (wide, high) = picture.size, covered.high - covered.low
        laid = f"mask ({size[0]} x {size[1]} pixels) over {covered.name} ({wide:.6g} x {high:.6g})"
        placed = [f"laid the {laid}"] * (target.size is None or size != (wide, high))
        levels = picture.channel
        # the last row and column of an averaged mask may extend beyond the picture
        overhang = np.array(levels.shape[::-1]) * picture.reduced / picture.size
        box = _normal_box(target, covered, overhang)
        pixel = np.array([box[3] - box[1], box[2] - box[0]]) / levels.shape
        sigma = np.minimum(EDGE_SIGMA / pixel, MAX_EDGE_SIGMA_PIXELS)
        smooth = np.clip(scipy.ndimage.gaussian_filter(levels, tuple(sigma), mode="nearest"), 0, 1)
        plain = cls(smooth.astype(np.float32), box, strength, str(path))
        share = _share_of(plain, target)
        notes = (*picture.notes, *placed, *_warnings(levels, share, plain.strength))
        return cls(plain.mask, box, strength, str(path), share, notes)

    def weight(self, points: ArrayLike) -> Array:
        """Return weights (...) at `points` (..., 2) of the normal form, from 1 to the strength.

        Bilinear between the centres of the mask's pixels; beyond the box it fades to 1 within
        0.05. Raises `OrbiflowError` for points of another shape or that are not finite.
        """
        return 1 + (self.strength - 1) * self.level(points)

    def report(self) -> dict[str, Any]:
        """Return what was read and decided, ready for JSON."""
        return {
            "source": self.source,
            "strength": float(self.strength),
            "share": self.share,
            "notes": list(self.notes),
        }

    def level(self, points: ArrayLike) -> Array:
        at = np.asarray(points, dtype=np.float64)
        if at.ndim == 0 or at.shape[-1] != 2 or not np.isfinite(at).all():
            raise OrbiflowError(
                f"points must have shape (..., 2) and finite coordinates, got shape {at.shape}"
            )
        xmin, ymin, xmax, ymax = self.box
        inside = np.clip(at, [xmin, ymin], [xmax, ymax])
        height, width = self.mask.shape
        column = (inside[..., 0] - xmin) / (xmax - xmin) * width - 0.5
        row = (ymax - inside[..., 1]) / (ymax - ymin) * height - 0.5
        level = scipy.ndimage.map_coordinates(
            self.mask, [row.ravel(), column.ravel()], output=np.float64, order=1, mode="nearest"
        ).reshape(row.shape)
        beyond = np.minimum(np.linalg.norm(at - inside, axis=-1) / FADE_WIDTH, 1.0)
        return level * (1 - beyond**2 * (3 - 2 * beyond))


def _normal_box(target: Target, covered: Covered, overhang: Array) -> Window:
    """Return the box in the normal form, extended to the right and downwards by `overhang`."""
    corners = target.to_normal([covered.low, covered.high])
    (xmin, ymin), (xmax, ymax) = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    right, down = overhang.tolist()
    return xmin, ymax - down * (ymax - ymin), xmin + right * (xmax - xmin), ymax


def _share_of(emphasis: Emphasis, target: Target) -> float:
    """Return the mean emphasis of the silhouette; an error where the mask does not touch it."""
    ring, region = target.normal, shapely.Polygon(target.normal)
    shapely.prepare(region)
    low, size = ring.min(axis=0), np.ptp(ring, axis=0)
    steps = (np.arange(GRID_SIDE) + 0.5) / GRID_SIDE
    along: list[Array] = [low[i] + size[i] * steps for i in range(2)]
    points = np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)
    levels = emphasis.level(points[shapely.contains_xy(region, points[:, 0], points[:, 1])])
    on_outline = emphasis.level(ring)
    if max(levels.max(initial=0), on_outline.max()) < MIN_TOUCHING_LEVEL:
        raise InputFileError(
            f"{emphasis.source}: what is painted, light or opaque, is only a speck or does not touch "
            "the silhouette; paint more of it on the silhouette, in the same picture"
        )
    return float(levels.mean()) if levels.size else float(on_outline.mean())


def _warnings(levels: Array, share: float, strength: float) -> list[str]:
    notes: list[str] = []
    lightest = float(levels.max())
    if lightest < 0.9:
        weight = 1 + (strength - 1) * lightest
        notes.append(
            f"the mask reaches {lightest:.0%} of full emphasis: weights go up to {weight:.3g}, not "
            f"{strength:g}"
        )
    if share > 0.5:
        notes.append(
            f"the mask emphasises {percent(share)} of the silhouette; if the other part was meant, "
            "invert the mask"
        )
    return notes
