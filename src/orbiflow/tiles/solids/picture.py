"""A picture of a solid: shaded, as seen from above and the front."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import palette, rgb
from orbiflow.tiles.solids.making import STL_TRIANGLE

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
TURN, TILT = np.radians([20.0, 52.0])  # of the view, about z and towards the viewer
LIGHT = np.array([-0.42, 0.35, 0.84])  # to the right, up, towards the viewer
FINER = 2
COLOURS = np.array([rgb(colour) for colour in palette("festival").colours], float)
AT_ONCE = 200_000  # rows of triangles


def read_solid(path: Path) -> list[Array]:
    """Return the triangles (n, 3, 3) of each part in a file that `Solid.write` has written."""
    if path.suffix == ".stl":
        return [np.frombuffer(path.read_bytes()[84:], STL_TRIANGLE)["corners"].astype(float)]
    with zipfile.ZipFile(path) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    found: list[Array] = []
    for own in model.iter(f"{CORE}object"):
        points, corners = (
            [list(row.attrib.values()) for row in own.iter(CORE + tag)]
            for tag in ("vertex", "triangle")
        )
        found.append(np.array(points, float)[np.array(corners, int)])
    return found


def solid_picture(parts: Sequence[Array], size: tuple[int, int] = (1000, 750)) -> Image.Image:
    """Return a picture of this width and height, with a colour for each part.

    What is higher is lighter.

    Args:
        parts: The triangles (n, 3, 3) of each part, counter-clockwise from outside, z up.
        size: Width and height in pixels.
    """
    corners = np.concatenate(parts)
    right, forward = (np.cos(TURN), np.sin(TURN), 0.0), (-np.sin(TURN), np.cos(TURN), 0.0)
    up = np.sin(TILT) * np.array(forward) + (0.0, 0.0, np.cos(TILT))
    eyes = np.stack([right, up, np.cross(right, up)], axis=1)
    seen = corners @ eyes
    low, high = seen.min(axis=(0, 1)), seen.max(axis=(0, 1))
    finer = FINER * np.array(size)
    scale = 0.94 * (finer / (high - low)[:2]).min()
    places = (seen - (low + high) / 2) * scale * (1, -1, 1) + (*(finer / 2), 0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) @ eyes
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    shades = 0.4 + 0.6 * np.clip(normals @ LIGHT, 0, 1)
    number = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    colours = shades[:, None] * COLOURS[number % len(COLOURS)]
    lights = 0.65 + 0.35 * corners[..., 2] / corners[..., 2].max()
    across, along = places[:, 1] - places[:, 0], places[:, 2] - places[:, 0]
    front = across[:, 0] * along[:, 1] < across[:, 1] * along[:, 0] - 1e-6  # y points down
    image = Image.fromarray(_painted(places[front], colours[front], lights[front], *finer.tolist()))
    return image.resize(size, Image.Resampling.LANCZOS)


def _painted(
    corners: Array, colours: Array, lights: Array, width: int, height: int
) -> NDArray[np.uint8]:
    """Paint triangles (n, 3, 3) in pixels, of which the nearest are seen, on white."""
    depth, pixels = np.full(width * height, -np.inf), np.full((width * height, 3), 255, np.uint8)
    # the shares of the corners in a point: affine in x and y
    planes = np.concatenate([corners[..., :2], np.ones((len(corners), 3, 1))], axis=2)
    planes = np.linalg.inv(planes.transpose(0, 2, 1))
    top = np.ceil(corners[..., 1].min(axis=1) - 0.5).astype(int)
    rows = np.floor(corners[..., 1].max(axis=1) - 0.5).astype(int) - top + 1
    for chunk in np.array_split(np.arange(len(corners)), rows.sum() // AT_ONCE + 1):
        which, row = _each(rows[chunk])
        which, row = chunk[which], row + top[chunk][which]
        slope = planes[which, :, 0]
        rest = planes[which, :, 1] * (row[:, None] + 0.5) + planes[which, :, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            zero = -rest / slope
        left = np.where(slope > 0, zero, 0.0).max(axis=1)
        right = np.where(slope < 0, zero, float(width)).min(axis=1)
        first = np.ceil(left - 0.5 - 1e-6).astype(int)
        count = np.floor(right - 0.5 + 1e-6).astype(int) - first + 1
        line, column = _each(np.maximum(count, 0))
        column = column + first[line]
        own = which[line]
        shares = slope[line] * (column[:, None] + 0.5) + rest[line]
        z = (shares * corners[own, :, 2]).sum(axis=1)
        place = row[line] * width + column
        order = np.argsort(z, kind="stable")
        order = order[z[order] > depth[place[order]]]  # of those at one place the nearest is last
        depth[place[order]] = z[order]
        light = (shares[order] * lights[own[order]]).sum(axis=1)
        pixels[place[order]] = light[:, None] * colours[own[order]]
    return pixels.reshape(height, width, 3)


def _each(counts: Integers) -> tuple[Integers, Integers]:
    """Return, for as many things as are counted, whose each is and its place among them.

    >>> [part.tolist() for part in _each(np.array([2, 0, 1]))]
    [[0, 0, 2], [0, 1, 0]]
    """
    whose = np.repeat(np.arange(len(counts)), counts)
    return whose, np.arange(len(whose)) - (np.cumsum(counts) - counts)[whose]
