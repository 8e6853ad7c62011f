"""Emphasis, a mask painted over the input picture that gives the plane's points weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from orbiflow.arguments import instance, number, numbers
from orbiflow.arrays import Array, Window
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.tiles.silhouette.outlines import clean_ring, percent
from orbiflow.tiles.silhouette.readers import MaskReading, read_mask
from orbiflow.tiles.silhouette.target import Target

MAX_STRENGTH = 100.0
MAX_ASPECT_ERROR = 0.01
# In the normal form, where the silhouette has area 1. The mask's edges are smoothed over a few points
# of a tile's boundary, so that the force on it is continuous.
SMOOTHING = 0.02  # standard deviation
FADE_WIDTH = 0.05  # beyond the mask's box
MAX_SMOOTHING = 32.0  # pixels: a bound of the work
MIN_TOUCHING_LEVEL = (
    0.01  # of full emphasis: what is nowhere above this on the silhouette does not touch it
)
GRID_SIDE = 512  # pixels along a side of the grids that integrals are taken on

_OUTLINE_BOX = "the outline's bounding box"


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
        number(self.strength, "strength of the emphasis", 1, MAX_STRENGTH, above=True)
        mask = numbers(self.mask, self.source, (...,), finite=False).astype(np.float32)
        if mask.ndim != 2 or not mask.size or not (mask.min() >= 0 and mask.max() <= 1):
            raise OrbiflowError(
                f"{self.source}: a mask needs shape (H, W) and values from 0 to 1, got {mask.shape}"
            )
        xmin, ymin, xmax, ymax = numbers(self.box, f"{self.source}: the box", (4,), finite=False)
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

        Raises `InputFileError` for a file over 64 MB or 40 megapixels, one that is damaged or not
        an image, a mask of another aspect, a uniform mask, and one that emphasises no part of the
        silhouette; `OrbiflowError` for a strength that is not above 1 and at most 100.
        """
        instance(target, Target, "the target", "Target.read and Target.from_polygon make one")
        path = Path(path)
        picture = read_mask(path)
        box, covered = _covered(target)
        placed = _check_aspect(path, picture, box, covered)
        levels = picture.levels
        # the last row and column of an averaged mask may extend beyond the picture
        overhang = np.array(levels.shape[::-1]) * picture.reduced / picture.size
        own = _normal_box(target, box, overhang)
        plain = cls(_smoothed(levels, own), own, strength, str(path))
        share = _share_of(plain, target)
        notes = (*picture.notes, *placed, *_warnings(levels, share, plain.strength))
        return cls(plain.mask, own, strength, str(path), share, notes)

    def weight(self, points: ArrayLike) -> Array:
        """Return weights (...) at `points` (..., 2) of the normal form, from 1 to the strength.

        Bilinear between the centres of the mask's pixels; beyond the box it fades to 1 within
        0.05. Raises `OrbiflowError` for points of another shape or that are not finite.
        """
        return 1 + (self.strength - 1) * self.level(points)

    def image(self, center: ArrayLike, reach: float, resolution: int) -> Array:
        """Return weights at the pixel centres of a square, (resolution, resolution), row 0 at least y.

        The grid of `SoftTarget`, and of `torch.nn.functional.grid_sample` without aligned corners:
        pixel (i, j) lies at `center` + `reach` * ((2 j + 1) / resolution - 1,
        (2 i + 1) / resolution - 1).
        """
        axis = reach * ((np.arange(resolution) + 0.5) / resolution * 2 - 1)
        x0, y0 = (float(c) for c in np.asarray(center, dtype=np.float64))
        return self.weight(np.stack(np.meshgrid(x0 + axis, y0 + axis), axis=-1))

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
        xmin, ymin, xmax, ymax = numbers(self.box, f"{self.source}: the box", (4,), finite=False)
        inside = np.clip(at, [xmin, ymin], [xmax, ymax])
        height, width = self.mask.shape
        column = (inside[..., 0] - xmin) / (xmax - xmin) * width - 0.5
        row = (ymax - inside[..., 1]) / (ymax - ymin) * height - 0.5
        level = map_coordinates(
            self.mask, [row.ravel(), column.ravel()], output=np.float64, order=1, mode="nearest"
        ).reshape(row.shape)
        beyond = np.minimum(np.linalg.norm(at - inside, axis=-1) / FADE_WIDTH, 1.0)
        return level * (1 - beyond**2 * (3 - 2 * beyond))


def emphasised_iou(tile: ArrayLike, target: ArrayLike, emphasis: Emphasis) -> float:
    """Return the weighted intersection over union, 0 to 1, of two rings (N, 2) in the normal form.

    The areas are sums of weights over the pixel centres of a grid of 512 x 512 on the box around
    both shapes, the same ones every time. For outlines of animals the result is within 0.001 of
    the exact integral (measured without emphasis, against `metrics.iou`); shapes that are thinner
    than a pixel, 1/512 of that box, are lost.

    Raises `OrbiflowError` naming the ring that is not a simple polygon.

    >>> square = [[0, 0], [2, 0], [2, 2], [0, 2]]
    >>> right = Emphasis(np.array([[0.0, 1.0]]), (-2, -2, 4, 4), strength=3.0)
    >>> emphasised_iou(square, square, right)
    1.0
    >>> emphasised_iou([[0, 0], [1, 0], [1, 2], [0, 2]], square, right) < 0.5
    True
    """
    rings = [clean_ring(tile, "tile")[0], clean_ring(target, "target")[0]]
    points = _grid(np.concatenate(rings))
    own, goal = (_contains(ring, points) for ring in rings)
    either = own | goal
    weight = emphasis.weight(points[either])
    total = float(weight.sum())
    return float(weight[(own & goal)[either]].sum()) / total if total else 0.0


def _grid(points: Array) -> Array:
    """Return centres (GRID_SIDE^2, 2) of the pixels of the box around `points`."""
    low, high = points.min(axis=0), points.max(axis=0)
    steps = (np.arange(GRID_SIDE) + 0.5) / GRID_SIDE
    along: list[Array] = [low[i] + (high[i] - low[i]) * steps for i in range(2)]
    return np.stack(np.meshgrid(*along), axis=-1).reshape(-1, 2)


def _contains(ring: Array, points: Array) -> NDArray[np.bool_]:
    region = shapely.Polygon(ring)
    shapely.prepare(region)
    return shapely.contains_xy(region, points[:, 0], points[:, 1])


def _covered(target: Target) -> tuple[Window, str]:
    """Return what a mask covers, (xmin, ymin, xmax, ymax) in input units, and its name."""
    if target.size is None:
        xmin, ymin = target.outline.min(axis=0)
        xmax, ymax = target.outline.max(axis=0)
        return (float(xmin), float(ymin), float(xmax), float(ymax)), _OUTLINE_BOX
    width, height = target.size
    xmin, ymin = target.corner
    name = "the drawing's page" if target.kind == "svg" else "the input picture"
    return (xmin, ymin, xmin + width, ymin + height), name


def _check_aspect(path: Path, picture: MaskReading, box: Window, covered: str) -> list[str]:
    """Return notes of where the mask was placed, or raise an error if it does not fit."""
    (width, height), wide, high = picture.size, box[2] - box[0], box[3] - box[1]
    mask, size = f"{width} x {height} pixels", f"{wide:.6g} x {high:.6g}"
    if abs(width * high / (height * wide) - 1) > MAX_ASPECT_ERROR:
        raise InputFileError(
            f"{path}: the mask is {mask} and {covered} is {size}; their aspects must agree within "
            "1%, so paint the mask over a copy of that size"
        )
    if (width, height) == (wide, high) and covered != _OUTLINE_BOX:
        return []
    return [f"laid the mask ({mask}) over {covered} ({size})"]


def _normal_box(target: Target, box: Window, overhang: Array) -> Window:
    """Return `box` in the normal form, extended to the right and downwards by `overhang`."""
    corners = target.to_normal([box[:2], box[2:]])
    xmin, ymin = corners.min(axis=0)
    xmax, ymax = corners.max(axis=0)
    right, down = overhang
    return (
        float(xmin),
        float(ymax - down * (ymax - ymin)),
        float(xmin + right * (xmax - xmin)),
        float(ymax),
    )


def _smoothed(levels: Array, box: Window) -> NDArray[np.float32]:
    xmin, ymin, xmax, ymax = box
    pixel = np.array([ymax - ymin, xmax - xmin]) / levels.shape
    sigma = np.minimum(SMOOTHING / pixel, MAX_SMOOTHING)
    smooth = gaussian_filter(levels, tuple(sigma), mode="nearest")
    return np.clip(smooth, 0, 1).astype(np.float32)


def _share_of(emphasis: Emphasis, target: Target) -> float:
    """Return the mean emphasis of the silhouette; an error where the mask does not touch it."""
    ring = target.normal
    points = _grid(ring)
    levels = emphasis.level(points[_contains(ring, points)])
    on_outline = emphasis.level(ring)
    if max(levels.max(initial=0), on_outline.max()) < MIN_TOUCHING_LEVEL:
        raise InputFileError(
            f"{emphasis.source}: the light (or opaque) part of the mask does not touch the "
            "silhouette, or is only a speck; paint it over the silhouette, in the same picture"
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
