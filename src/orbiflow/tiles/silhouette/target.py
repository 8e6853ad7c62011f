"""The silhouette that a tile should look like, in the user's coordinates and in normal form."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import shapely
from numpy.typing import ArrayLike
from shapely.geometry import Polygon

from orbiflow.arrays import Array
from orbiflow.errors import Advice, InputFileError, OrbiflowError, literal
from orbiflow.settings import as_array, described, is_a, is_tensor
from orbiflow.tiles.geometry import centroid, orient, polygons_in, signed_area
from orbiflow.tiles.silhouette import readers  # read when a file is
from orbiflow.tiles.silhouette.outlines import (
    LEFT_OUT,
    clean_ring,
    closed,
    opened,
    outer_ring,
    percent,
    rounded,
    still_left_out,
)
from orbiflow.tiles.silhouette.readers import FileContent, Reading
from orbiflow.tiles.silhouette.thickening import thickened

if TYPE_CHECKING:
    import torch

FUR_GAP_SHARE = 0.015  # of the silhouette's length: gaps narrower than this are not seen in a tile
SLIVER_WIDTHS = 0.1  # of a width: what is rounded off and thinner is no more than another polygon
LIMB_WIDTHS = 2.0  # widths: what is rounded off and longer is a limb, and no corner or bump
ASPECT_TOLERANCE = 0.01  # relative difference up to which two aspect ratios count as the same


HOW_TO_GET_A_TARGET = "Target.read, Target.from_mask and Target.from_polygon make one"
"""How a target is made, for messages."""


class Covered(NamedTuple):
    """The rectangle that a picture of a silhouette covers, in the input's units, and its name."""

    low: Array
    high: Array
    name: str
    y_down: bool = True

    def shares(self, points: Array) -> Array:
        """Return points (..., 2) in widths and heights of the picture, from its upper left corner."""
        shares = (points - self.low) / (self.high - self.low)
        if not self.y_down:
            shares[..., 1] = 1 - shares[..., 1]
        return shares

    def at(self, shares: Array) -> Array:
        """Return the points (..., 2) that have these `shares`."""
        upright = shares if self.y_down else (shares - (0, 1)) * (1, -1)
        return upright * (self.high - self.low) + self.low

    def require_aspect(self, path: Path | FileContent, what: str, size: Sequence[float]) -> None:
        """Refuse a picture, drawing or mask of this width and height unless its aspect is the same."""
        (width, height), (wide, high) = size, self.high - self.low
        if abs(width * high / (height * wide) - 1) > ASPECT_TOLERANCE:
            raise InputFileError(
                f"{path}: the {what} is {width:.6g} x {height:.6g} and {self.name} is "
                f"{wide:.6g} x {high:.6g}; a {what} covers all of that and must have its aspect "
                "within 1 %, so paint or draw over a copy of it"
            )


@dataclass(frozen=True, eq=False)
class Frame:
    """The map input = linear normal + offset from a normal form (y up, area 1, centroid 0).

    - `linear`: An invertible matrix (2, 2), in input units per unit of the normal form; read-only.
    - `offset`: The origin (2,) of the normal form in input units; read-only.
    - `kind`: The kind of the input: "image", "svg", "dat", "json" or "polygon".
    - `size`: The width and height of the picture or page in input units, if there is one.
    - `corner`: Its corner of least coordinates. In an image it is (0, 0) and the unit is the pixel: the
      pixel in row i, column j, counted from 0, has its centre at (j + 1/2, i + 1/2).

    Raises `OrbiflowError` for arrays of other shapes, entries that are not finite numbers, and a
    matrix without an inverse.

    >>> frame = Frame([[20, 0], [0, -20]], [50, 40], kind="image", size=(100, 80))
    >>> frame.to_input([1.0, 1.0]).tolist(), frame.to_normal([70, 20]).tolist(), frame.y_down
    ([70.0, 20.0], [1.0, 1.0], True)
    """

    linear: Array
    offset: Array
    kind: str = "polygon"
    size: tuple[float, float] | None = None
    corner: tuple[float, float] = (0.0, 0.0)
    inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        linear = as_array(self.linear, "a frame's linear", (2, 2))
        size = None if self.size is None else _pair(self.size, "size")
        if size is not None and not min(size) > 0:
            raise OrbiflowError(f"a frame's size must be positive, got {size}")
        # relative to the scale: a frame may be tiny
        determinant = linear[0, 0] * linear[1, 1] - linear[0, 1] * linear[1, 0]
        if not abs(determinant) > 1e-12 * np.abs(linear).max() ** 2:
            raise OrbiflowError(f"a frame's linear part has no inverse: {linear.tolist()}")
        arrays = {
            "linear": linear,
            "offset": as_array(self.offset, "a frame's offset", (2,)),
            "inverse": np.linalg.inv(linear),
        }
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "corner", _pair(self.corner, "corner"))

    @classmethod
    def upright(cls, size: float = 1.0, *, y_down: bool) -> Frame:
        """Return the frame about the origin of coordinates whose y may point down, by a scale."""
        return cls(size * np.diag([1.0, -1.0 if y_down else 1.0]), np.zeros(2))

    @property
    def y_down(self) -> bool:
        """Whether the input's y axis points down: the frame turns the plane over."""
        return bool(np.linalg.det(self.linear) < 0)

    def to_input(self, points: Any) -> Any:
        """Return points (..., 2) of the normal form in the input's units; arrays, lists or tensors."""
        if is_tensor(points):
            points = _tensor(points)
            return points @ points.new_tensor(self.linear).T + points.new_tensor(self.offset)
        return as_array(points, "points", (..., 2), finite=False) @ self.linear.T + self.offset

    def to_normal(self, points: Any) -> Any:
        """Return points (..., 2) in the input's units, in the normal form; arrays, lists or tensors."""
        if is_tensor(points):
            points = _tensor(points)
            return (points - points.new_tensor(self.offset)) @ points.new_tensor(self.inverse).T
        local = as_array(points, "points", (..., 2), finite=False) - self.offset
        scale = np.diag(self.linear)
        if np.array_equal(self.linear, np.diag(scale)):
            return local / scale  # rounded once
        return local @ self.inverse.T

    def covered(self, outline: Array) -> Covered:
        """Return what a picture covers: the input picture, the drawing's page, or an outline's box."""
        if self.size is None:
            low, high = outline.min(axis=0), outline.max(axis=0)
            return Covered(low, high, "the silhouette's bounding box", self.y_down)
        low = np.array(self.corner)
        name = "the drawing's page" if self.kind == "svg" else "the silhouette's picture"
        return Covered(low, low + self.size, name, self.y_down)

    def as_dict(self) -> dict[str, Any]:
        """Return everything, ready for JSON; `from_dict` undoes it bit for bit."""
        return {
            "linear": self.linear.tolist(),
            "offset": self.offset.tolist(),
            "y_down": self.y_down,
            "kind": self.kind,
            "size": None if self.size is None else list(self.size),
            "corner": list(self.corner),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """Return the frame that `as_dict` wrote.

        Raises `OrbiflowError` for values that are missing or do not make a frame.
        """
        try:
            size = values["size"]
            return cls(
                values["linear"],
                values["offset"],
                str(values["kind"]),
                None if size is None else tuple(size),
                tuple(values["corner"]),
            )
        except (KeyError, TypeError) as error:
            raise OrbiflowError(f"the frame is incomplete: {error}") from error


def _tensor(points: torch.Tensor) -> torch.Tensor:
    if points.ndim == 0 or points.shape[-1] != 2:
        raise OrbiflowError(f"points: expected shape (..., 2), got {tuple(points.shape)}")
    return points if points.is_floating_point() else points.double()


def _pair(values: Any, name: str) -> tuple[float, float]:
    first, second = as_array(values, f"a frame's {name}", (2,)).tolist()
    return first, second


@dataclass(frozen=True, eq=False)
class Target(Reading):
    """A silhouette: one simple closed curve, with all that its `Reading` has.

    Create one with `Target.read`, `from_bytes`, `from_mask` or `from_polygon`, which check the
    outline. It is read-only, and counter-clockwise in the normal form.

    - `source`: The file's name, or a name for another source.

    >>> target = Target.from_polygon([[0, 0], [2, 0], [2, 2], [0, 2]])
    >>> target.normal.tolist()
    [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]
    >>> target.to_input([0.5, 0.5])
    array([2., 2.])
    """

    source: str = "polygon"

    def __post_init__(self) -> None:
        outline = orient(np.array(self.outline, float), counter_clockwise=not self.y_down)
        outline.setflags(write=False)
        object.__setattr__(self, "outline", outline)

    @classmethod
    def read(
        cls, path: str | Path, *, threshold: float | None = None, invert: bool | None = None
    ) -> Self:
        """Read a silhouette from an image (PNG, JPEG, WebP), an SVG, a `.json` or a `.dat` file.

        For images, `threshold` (0 to 1) is the level that separates the shape from its background,
        and `invert` says that the shape is the light (or the transparent) part. By default both are
        detected, and `notes` report the result.

        Raises `InputFileError` for a file without a usable silhouette, with what to do about it.
        """
        reading = readers.read_outline(path, threshold=threshold, invert=invert)
        return cls(**vars(reading), source=str(path))

    @classmethod
    def from_bytes(
        cls,
        data: bytes | bytearray | memoryview,
        name: str = "bytes",
        *,
        threshold: float | None = None,
        invert: bool | None = None,
    ) -> Self:
        """Read the content of such a file; `name` is used in messages and for its ending.

        >>> Target.from_bytes(b"[[0, 0], [2, 0], [2, 2], [0, 2]]").kind
        'json'
        """
        if not is_a(data, bytes | bytearray | memoryview):
            raise OrbiflowError(
                f"data must be bytes, got {described(data)}; Target.read takes paths"
            )
        held = FileContent(bytes(data), str(name))
        reading = readers.read_outline(held, threshold=threshold, invert=invert)
        return cls(**vars(reading), source=held.name)

    @classmethod
    def from_mask(
        cls,
        mask: ArrayLike,
        *,
        threshold: float | None = None,
        invert: bool | None = None,
        source: str = "mask",
    ) -> Self:
        """Return the largest shape in an array (H, W), a row of pixels at a time, the first on top.

        Booleans, and integers that are only 0 and 1, are true in the shape (with `invert`,
        outside). Other integers and floats are gray levels, from 0 to 255, 65535 or 1, and are read
        like those of images: by default `threshold` and `invert` are detected.

        Raises `OrbiflowError` for another array, and `InputFileError` for one without a shape.

        >>> import numpy as np
        >>> mask = np.zeros((60, 80), bool)
        >>> mask[10:50, 20:70] = True
        >>> round(Target.from_mask(mask).area)
        2000
        """
        reading = readers.read_mask_array(mask, source, threshold=threshold, invert=invert)
        return cls(**vars(reading), source=source)

    @classmethod
    def from_polygon(
        cls, points: ArrayLike, *, y_down: bool = False, source: str = "polygon"
    ) -> Self:
        """Return the silhouette bounded by the polygon `points` (N, 2), closed or not, in either sense.

        Raises `OrbiflowError` for coordinates that are not finite, fewer than 3 vertices, no area,
        or a polygon that crosses or touches itself.
        """
        with np.errstate(all="ignore"):  # what overflows is refused
            outline, notes = clean_ring(points, source)
        return cls(outline, y_down, notes=tuple(notes), source=source)

    def smoothed(self, share: float) -> Self:
        """Return the silhouette with what is narrower than a share of its length rounded off.

        Gaps are closed first, between its parts, too, and then limbs and bumps go. Notes say how many
        parts are still left out, how much of the silhouette went, and how many limbs.

        Raises `OrbiflowError` if nothing is left.

        >>> target = Target.from_polygon([[0, 0], [8, 0], [8, 8], [4.1, 8], [4, 9], [3.9, 8], [0, 8]])
        >>> float(target.outline.max()), float(target.smoothed(0.1).outline.max().round(1))
        (9.0, 8.2)
        """
        if share == 0:
            return self
        length = float(np.ptp(self.outline, axis=0).max())
        whole = Polygon(self.outline)  # which may be more than what was seen: what lines enclose
        seen = whole if self.seen is None else shapely.union_all([whole, self.seen.buffer(0)])
        shape = rounded(whole, seen, share * length)
        if shape.is_empty:
            raise OrbiflowError(
                Advice(
                    literal(f"{self.source}: ")
                    + f"{{smooth}} {share:g} leaves nothing of the silhouette; choose less"
                )
            )
        went = whole.difference(shape)
        width = share * length
        parts = polygons_in(opened(went, SLIVER_WIDTHS * width))
        limbs = sum(_reach(part) > LIMB_WIDTHS * width for part in parts)
        lost = f"{percent(went.area / self.area)} of the area"
        named = f" and {limbs} limb{'s' * (limbs > 1)}" if limbs else ""
        note = (
            f"rounded off what is narrower than {percent(share)} of the length: {lost}{named} went"
        )
        notes = self.notes
        if self.seen is not None and any(other.startswith(LEFT_OUT) for other in notes):
            notes = (other for other in notes if not other.startswith(LEFT_OUT))
            notes = (*notes, *still_left_out(shape, seen))
        return replace(self, outline=outer_ring(shape), notes=(*notes, note))

    def thickened(self, share: float) -> Self:
        """Return the silhouette with parts thinner than a share of its length grown to this width.

        Gaps between parts stay open, and a note says by how much the silhouette has grown.

        >>> bar = [[0, 4], [0, 0], [4, 0], [4, 1.9], [9, 1.9], [9, 2.1], [4, 2.1], [4, 4]]
        >>> target = Target.from_polygon(bar).thickened(0.1)
        >>> float(target.outline[:, 0].max().round(1)), target.notes
        (9.3, ('grew parts thinner than 10.0% of the length, by 21.7% of the area',))
        """
        if share == 0:
            return self
        before = Polygon(self.outline)
        shape = thickened(before, share * float(np.ptp(self.outline, axis=0).max()))
        more = percent(shape.area / before.area - 1)
        note = f"grew parts thinner than {percent(share)} of the length, by {more} of the area"
        seen = None if self.seen is None else self.seen.buffer(0).union(shape.difference(before))
        return replace(self, outline=outer_ring(shape), notes=(*self.notes, note), seen=seen)

    @property
    def area(self) -> float:
        """The area of the silhouette in square input units."""
        return float(abs(signed_area(self.outline)))

    @cached_property
    def frame(self) -> Frame:
        """The map from the normal form to the input: a scale, a flip of y and a translation."""
        linear = np.sqrt(self.area) * np.diag([1.0, -1.0 if self.y_down else 1.0])
        return Frame(linear, centroid(self.outline), self.kind, self.size, self.corner)

    @property
    def covered(self) -> Covered:
        """What a picture of the silhouette covers."""
        return self.frame.covered(self.outline)

    @cached_property
    def normal(self) -> Array:
        """The outline (N, 2), counter-clockwise with y up, area 1 and centroid 0."""
        normal = self.to_normal(self.outline)
        normal.setflags(write=False)
        return normal

    @cached_property
    def without_fur(self) -> Array:
        """The outline (N, 2) in the normal form with the gaps between hairs filled: `FUR_GAP_SHARE`."""
        width = FUR_GAP_SHARE * float(np.ptp(self.normal, axis=0).max())
        return orient(outer_ring(closed(Polygon(self.normal), width)))

    def to_input(self, points: ArrayLike) -> Array:
        """Return `points` (..., 2) of the normal form in the input's units: `frame.to_input`."""
        return self.frame.to_input(points)

    def to_normal(self, points: ArrayLike) -> Array:
        """Return `points` (..., 2) in the input's units, in the normal form: `frame.to_normal`."""
        return self.frame.to_normal(points)

    def report(self) -> dict[str, Any]:
        """Return what was read and decided, ready for JSON."""
        return {
            "source": self.source,
            "kind": self.kind,
            "size": None if self.size is None else list(self.size),
            "vertices": len(self.outline),
            "area": self.area,
            "y_down": self.y_down,
            "notes": list(self.notes),
        }


def _reach(part: Polygon) -> float:
    """Return the longer side of a part's box."""
    xmin, ymin, xmax, ymax = part.bounds
    return max(xmax - xmin, ymax - ymin)
