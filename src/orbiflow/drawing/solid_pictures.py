"""Pictures of solids: shaded, seen from any side, in soft light that dims in hollows.

Lengths are in any unit; z is up unless a view says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image
from scipy.ndimage import zoom

from orbiflow.arrays import Array, Integers
from orbiflow.drawing.palettes import palette
from orbiflow.drawing.raster import rgb
from orbiflow.drawing.solid_raster import PIXELS_AT_ONCE, SeenTriangles, each, nearest_triangles

FINER = 2
"""Factor by which each side of a pixel is drawn finer."""

CREASE = 50.0
"""Angle in degrees between two faces beyond which their edge is drawn sharp."""

EYE_DISTANCE = 5.0
"""Distance of the eye from the middle, in radii of what is seen."""

KEY_LIGHT = np.array([-0.501, 0.621, 0.601], np.float32)
FILL_LIGHT = np.array([0.827, 0.11, 0.551], np.float32)
HALFWAY = np.array([-0.28, 0.347, 0.895], np.float32)
"""Unit vectors to where light comes from, and halfway from the first to the viewer: right, up, near."""

WARM, COOL = np.array([1.0, 0.985, 0.95], np.float32), np.array([0.95, 0.98, 1.0], np.float32)
"""The colours of the first light, and of what comes from all around."""

KEY, FILL, SKY, GROUND_LIGHT, GLOSS = 0.8, 0.18, 0.46, 0.22, 0.1
"""Strengths of the two lights, of what comes from above and from below, and of the gleam."""

HOLLOW_RADIUS, HOLLOW = 0.16, 1.35
"""How far hollows reach, as a share of the radius of what is seen, and how much darker they are."""

OUTLINE = 0.45
"""Share of its light that a pixel keeps where another part, or another depth, begins."""

FROM_ABOVE = (0.27, -0.74, 0.62)
"""The direction from which `solid_picture` looks."""


@dataclass(frozen=True, eq=False)
class ShadedPart:
    """A part of a picture.

    - `corners`: Its triangles (n, 3, 3), counter-clockwise from outside.
    - `normals`: The unit normals (n, 3, 3) at their corners, by which they are shaded.
    - `colour`: Its colour, as #rrggbb.
    """

    corners: Array
    normals: Array
    colour: str

    @classmethod
    def flat(cls, corners: Array, colour: str) -> ShadedPart:
        """Return a part of triangles (n, 3, 3), each of which shows as a flat."""
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return cls(corners, np.repeat(_unit(normals)[:, None], 3, axis=1), colour)

    @classmethod
    def smooth(
        cls, points: Array, faces: Integers, colour: str, crease: float = CREASE
    ) -> ShadedPart:
        """Return a part of points (N, 3) and faces (M, 3) that is round but for its creases.

        `crease` is the angle in degrees between two faces beyond which their edge is sharp.
        """
        return cls(points[faces], crease_normals(points, faces, crease), colour)

    def moved(self, linear: ArrayLike, shift: ArrayLike = (0.0, 0.0, 0.0)) -> ShadedPart:
        """Return the part under x -> linear x + shift, where linear is orthogonal."""
        matrix = np.asarray(linear, float)
        corners, normals = (
            self.corners @ matrix.T + np.asarray(shift, float),
            self.normals @ matrix.T,
        )
        order = slice(None) if np.linalg.det(matrix) > 0 else slice(None, None, -1)
        return replace(self, corners=corners[:, order], normals=normals[:, order])

    def coloured(self, colour: str) -> ShadedPart:
        """Return the part in another colour."""
        return replace(self, colour=colour)


@dataclass(frozen=True)
class SolidView:
    """From where a picture is seen.

    - `direction`: From the middle towards the eye (3,).
    - `up`: What is up in the picture (3,).
    - `middle`, `radius`: The ball that the picture shows. Default: what the parts need.
    """

    direction: tuple[float, float, float] = FROM_ABOVE
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)
    middle: tuple[float, float, float] | None = None
    radius: float | None = None

    @cached_property
    def axes(self) -> Array:
        """The unit vectors to the right, up and towards the eye, as columns (3, 3)."""
        eye = _unit(np.asarray(self.direction, float))
        right = np.cross(np.asarray(self.up, float), eye)
        if np.linalg.norm(right) < 1e-9:
            right = np.cross((0.0, 1.0, 0.0) if abs(eye[1]) < 0.9 else (1.0, 0.0, 0.0), eye)
        right = _unit(right)
        return np.stack([right, np.cross(eye, right), eye], axis=1)


def draw_solids(
    parts: Sequence[ShadedPart],
    size: tuple[int, int],
    view: SolidView | None = None,
    *,
    ground: str | None = "#ffffff",
    outlined: bool = True,
    margin: float = 0.04,
) -> Image.Image:
    """Return a picture of parts, those in front over those behind.

    Args:
        parts: What is seen, in its place.
        size: Width and height in pixels.
        view: From where it is seen. Default: from above and the front.
        ground: The colour behind the parts, as #rrggbb; None leaves it transparent.
        outlined: Draw a thin line where one part or depth ends and another begins.
        margin: Share of each side that is left free, where the view has no radius.
    """
    view, width, height = view or SolidView(), FINER * size[0], FINER * size[1]
    corners = np.concatenate([np.zeros((0, 3, 3)), *(part.corners for part in parts)])
    normals = np.concatenate([np.zeros((0, 3, 3)), *(part.normals for part in parts)])
    owner = np.repeat(np.arange(len(parts)), [len(part.corners) for part in parts])
    places, scale = _projected(corners, view, width, height, margin)
    across, along = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    turned = across[:, 0] * along[:, 1] < across[:, 1] * along[:, 0] - 1e-9  # y points down
    places, normals, owner = places[turned], normals[turned], owner[turned]
    seen = nearest_triangles(places, width, height)
    part = owner[seen.triangle[seen.covered]]
    directions = _unit(seen.interpolated(normals @ view.axes))
    colours = np.array([_linear(rgb(shaded.colour)) for shaded in parts], np.float32).reshape(-1, 3)
    dimmed = _openness(seen, directions, scale * HOLLOW_RADIUS)
    pixels = np.empty((len(part), 4), np.uint8)
    pixels[:, 3] = 255
    lines = _outline(seen, part, scale) if outlined else np.ones(len(part), np.float32)
    for first in range(0, len(part), PIXELS_AT_ONCE):
        some = slice(first, first + PIXELS_AT_ONCE)
        light = _light(directions[some]) * dimmed[some, None] * colours[part[some]]
        light += GLOSS * _gleam(directions[some])[:, None]
        pixels[some, :3] = 255 * lines[some, None] * _encoded(light) + 0.5
    image = np.zeros((height, width, 4), np.uint8)
    image[seen.covered] = pixels
    return _reduced(image, ground)


def solid_picture(parts: Sequence[Array], size: tuple[int, int] = (1000, 750)) -> Image.Image:
    """Return a picture on white from above and the front, with a colour for each part.

    Args:
        parts: The triangles (n, 3, 3) of each part, counter-clockwise from outside, z up.
        size: Width and height in pixels.
    """
    colours = palette("festival").colours
    shaded = [ShadedPart.flat(part, colours[k % len(colours)]) for k, part in enumerate(parts)]
    return draw_solids(shaded, size)


def crease_normals(points: Array, faces: Integers, crease: float = CREASE) -> Array:
    """Return unit normals (M, 3, 3) at the corners of faces (M, 3) of points (N, 3).

    Each is the mean, by area, of the faces about that point that make an angle of at most `crease`
    degrees with the corner's own.
    """
    first, second, third = points[faces].swapaxes(0, 1)
    vectors = np.cross(second - first, third - first)
    units = _unit(vectors)
    order = np.argsort(faces.ravel(), kind="stable")  # corners, point by point
    counts = np.bincount(faces.ravel(), minlength=len(points))
    starts = np.cumsum(counts) - counts
    around = counts[faces.ravel()]
    corner, place = each(around)
    other = order[starts[faces.ravel()][corner] + place] // 3
    face = corner // 3
    alike = np.einsum("ij,ij->i", units[face], units[other]) >= np.cos(np.radians(crease)) - 1e-9
    corner, other = corner[alike | (face == other)], other[alike | (face == other)]
    sums = [np.bincount(corner, vectors[other, k], faces.size) for k in range(3)]
    return _unit(np.stack(sums, axis=1)).reshape(-1, 3, 3)


def _unit(vectors: Array) -> Array:
    lengths = np.sqrt(np.einsum("...i,...i->...", vectors, vectors))
    return vectors / np.maximum(lengths, 1e-12)[..., None]


def _projected(
    corners: Array, view: SolidView, width: int, height: int, margin: float
) -> tuple[Array, float]:
    """Return corners (n, 3, 3) in pixels, z towards the eye in pixels too, and the radius in pixels."""
    if not len(corners):
        return corners, 1.0
    flat = corners.reshape(-1, 3)
    middle = (flat.min(axis=0) + flat.max(axis=0)) / 2
    middle = middle if view.middle is None else np.asarray(view.middle, float)
    seen = (corners - middle) @ view.axes
    radius = view.radius or float(np.linalg.norm(seen, axis=2).max()) or 1.0
    seen = seen / radius
    # parallel planes stay planes, so depths are affine in the picture
    seen = seen / (1 - np.minimum(seen[..., 2:], 0.8 * EYE_DISTANCE) / EYE_DISTANCE)
    middle_seen, scale = np.zeros(3), min(width, height) / 2 * 0.97
    if view.radius is None:
        low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
        middle_seen[:2] = ((low + high) / 2)[:2]
        scale = (1 - 2 * margin) * float((np.array([width, height]) / (high - low)[:2]).min())
    pixels = (seen - middle_seen) * scale * (1, -1, 1) + (width / 2, height / 2, 0)
    return pixels, scale


def _light(directions: Array) -> Array:
    """Return how much light (n, 3) falls on places with these normals, as the viewer has them."""
    key = np.clip(directions @ KEY_LIGHT, 0, 1)
    fill = np.clip(directions @ FILL_LIGHT, 0, 1)
    around = FILL * fill + GROUND_LIGHT + (SKY - GROUND_LIGHT) * (0.5 + 0.5 * directions[:, 1])
    return KEY * key[:, None] * WARM + around[:, None] * COOL


def _gleam(directions: Array) -> Array:
    """Return how much of the first light is mirrored towards the viewer (n,)."""
    square = np.clip(directions @ HALFWAY, 0, 1) ** 2
    eighth = (square * square) ** 2
    return eighth * eighth * eighth


OFFSETS = 20
"""Places about a pixel that are asked whether they shade it."""


def _openness(seen: SeenTriangles, directions: Array, radius: float) -> Array:
    """Return how much of the light from around reaches the covered pixels (n,).

    Places nearby that stand out before the plane through a pixel keep light from it (Crytek's ambient
    occlusion in screen space, 2007, here with the normal). It is asked at every second pixel.
    """
    step = 2 * FINER if min(seen.depth.shape) > 600 else FINER
    coarse = seen.depth[::step, ::step]
    there = np.isfinite(coarse)
    normals = np.zeros((*seen.depth.shape, 3), np.float32)
    normals[seen.covered] = directions
    normals = normals[::step, ::step]
    z = np.where(there, coarse, -1e9).astype(np.float32)
    reach = radius / step
    shade = np.zeros(z.shape, np.float32)
    for k in range(OFFSETS):
        angle, distance = 2.399963 * k, reach * ((k + 0.7) / OFFSETS) ** 0.8
        dx, dy = round(distance * np.cos(angle)), round(distance * np.sin(angle))
        if dx or dy:
            x, y = np.float32(dx * step), np.float32(-dy * step)
            rise = _shifted(z, dx, dy) - z
            length = np.sqrt(x * x + y * y + rise * rise)
            above = normals[..., 0] * x + normals[..., 1] * y + normals[..., 2] * rise
            above = above / length
            shade += np.clip(above - 0.12, 0, 1) / (1 + (length / radius) ** 2)
    amount = np.exp(-HOLLOW * 2.6 * shade / OFFSETS)
    amount[~there] = 1.0
    height, width = seen.depth.shape
    fine = zoom(amount, step, order=1, grid_mode=True, mode="nearest")
    fine = np.pad(
        fine, ((0, max(0, height - len(fine))), (0, max(0, width - fine.shape[1]))), "edge"
    )
    return fine[:height, :width][seen.covered]


def _shifted(values: NDArray[np.float32], dx: int, dy: int) -> NDArray[np.float32]:
    """Return an array whose value at (y, x) is another's at (y + dy, x + dx), far back beyond it."""
    height, width = values.shape
    shifted = np.full_like(values, -1e9)
    to = slice(max(0, -dy), min(height, height - dy)), slice(max(0, -dx), min(width, width - dx))
    of = slice(max(0, dy), min(height, height + dy)), slice(max(0, dx), min(width, width + dx))
    shifted[to] = values[of]
    return shifted


def _outline(seen: SeenTriangles, part: Integers, scale: float) -> Array:
    """Return the share of light (n,) that covered pixels keep: less where a part or a depth ends."""
    parts = np.full(seen.depth.shape, -1)
    parts[seen.covered] = part
    depth = np.where(seen.covered, seen.depth, -1e9).astype(np.float32)
    light = np.ones(seen.depth.shape, np.float32)
    for axis in (0, 1):
        before: list[slice] = [slice(None), slice(None)]
        after = before.copy()
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        here, other = tuple(before), tuple(after)
        step = depth[here] - depth[other]
        ends = np.clip((abs(step) / scale - 0.02) / 0.05, 0, 1)
        ends[parts[here] != parts[other]] = 1.0
        kept = 1 - (1 - OUTLINE) * ends
        # the line lies on what is in front
        light[here] = np.where(step >= 0, np.minimum(kept, light[here]), light[here])
        light[other] = np.where(step <= 0, np.minimum(kept, light[other]), light[other])
    return light[seen.covered]


def _linear(colour: tuple[int, int, int]) -> Array:
    """Return the light of a colour, after sRGB but for its toe."""
    return (np.array(colour) / 255) ** 2.2


def _encoding() -> NDArray[np.float32]:
    light = np.linspace(0, 2, 4097)
    tamed = np.where(light > 0.8, 0.8 + 0.2 * np.tanh((light - 0.8) / 0.2), light)
    return (tamed ** (1 / 2.2)).astype(np.float32)


ENCODED = _encoding()
"""The colours from 0 to 1 of light from 0 to 2, of which too much turns pale instead of clipping."""


def _encoded(light: Array) -> NDArray[np.float32]:
    """Return the colours from 0 to 1 of light."""
    return ENCODED[np.minimum(light * 2048, 4096).astype(np.int16)]


def _reduced(pixels: NDArray[np.uint8], ground: str | None) -> Image.Image:
    """Return a picture of pixels (height, width, 4), averaged and laid on a ground."""
    # transparent pixels have no colour
    image = Image.fromarray(pixels).convert("RGBa").reduce(FINER).convert("RGBA")
    if ground is None:
        return image
    whole = Image.new("RGBA", image.size, (*rgb(ground), 255))
    return Image.alpha_composite(whole, image).convert("RGB")
