"""Draw solids: `python docs/gallery/solid_picture.py tile.3mf cutter.3mf --out solids.webp`."""

from __future__ import annotations

import argparse
import zipfile
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import palette, rgb

CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
WIDTH, HEIGHT, COLUMNS, FINER = 560, 420, 3, 2
LIGHT = np.array([-0.42, 0.35, 0.84])  # to the right, up, towards the viewer
COLOURS = [np.array(rgb(colour), float) for colour in palette("festival").colours]


def triangles(path: Path) -> list[Array]:
    """Return the triangles (n, 3, 3) of each object of a 3MF file of our own."""
    with zipfile.ZipFile(path) as archive:
        model = ElementTree.fromstring(archive.read("3D/3dmodel.model"))
    found = []
    for own in model.iter(f"{CORE}object"):
        points, corners = (
            [list(row.attrib.values()) for row in own.iter(CORE + tag)]
            for tag in ("vertex", "triangle")
        )
        found.append(np.array(points, float)[np.array(corners, int)])
    return found


def drawn(parts: list[Array], turn: float = 20.0, tilt: float = 52.0) -> Image.Image:
    """Draw parts as seen from above and the front; what is higher is lighter."""
    a, b = np.radians([turn, tilt])
    right, forward = np.array([np.cos(a), np.sin(a), 0]), np.array([-np.sin(a), np.cos(a), 0])
    up = np.sin(b) * forward + np.array([0, 0, np.cos(b)])
    eyes = np.stack([right, up, np.cross(right, up)], axis=1)
    low, high = (
        edge(np.concatenate(parts).reshape(-1, 3) @ eyes, axis=0) for edge in (np.min, np.max)
    )
    size = np.array([WIDTH, HEIGHT]) * FINER
    scale = 0.94 * (size / (high - low)[:2]).min()
    top = max(part[..., 2].max() for part in parts)
    depth = np.full(size[::-1], -np.inf)
    pixels = np.full((*depth.shape, 3), 255.0)
    for part, colour in zip(parts, COLOURS * len(parts), strict=False):
        places = (part @ eyes - (low + high) / 2) * scale * (1, -1, 1) + (*(size / 2), 0)
        normals = np.cross(part[:, 1] - part[:, 0], part[:, 2] - part[:, 0]) @ eyes
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        shades = 0.4 + 0.6 * np.clip(normals @ LIGHT, 0, 1)
        heights = 0.65 + 0.35 * part[..., 2] / top
        for k in np.flatnonzero(normals[:, 2] > 0):
            _fill(depth, pixels, places[k], shades[k] * colour, heights[k])
    image = Image.fromarray(pixels.clip(0, 255).astype(np.uint8))
    return image.resize((WIDTH, HEIGHT), Image.Resampling.LANCZOS)


def _fill(depth: Array, pixels: Array, corners: Array, colour: Array, light: Array) -> None:
    """Fill a triangle (3, 3) where nothing nearer has been drawn."""
    low = np.floor(corners[:, :2].min(axis=0)).astype(int)
    high = np.ceil(corners[:, :2].max(axis=0)).astype(int) + 1
    x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    first, second = corners[1] - corners[0], corners[2] - corners[0]
    area = first[0] * second[1] - first[1] * second[0]
    if abs(area) < 1e-9:
        return
    x, y = x - corners[0, 0], y - corners[0, 1]
    u, v = (x * second[1] - y * second[0]) / area, (y * first[0] - x * first[1]) / area
    z = corners[0, 2] + u * first[2] + v * second[2]
    window = slice(low[1], high[1]), slice(low[0], high[0])
    near = (np.minimum(u, v) > -1e-6) & (u + v < 1 + 1e-6) & (z > depth[window])
    shade = light[0] + u * (light[1] - light[0]) + v * (light[2] - light[0])
    depth[window][near], pixels[window][near] = z[near], shade[near, None] * colour


def main() -> None:
    """Draw the files, three in a row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows = -(-len(options.files) // COLUMNS)
    sheet = Image.new("RGB", (WIDTH * COLUMNS, HEIGHT * rows), "white")
    for k, path in enumerate(options.files):
        sheet.paste(drawn(triangles(path)), (k % COLUMNS * WIDTH, k // COLUMNS * HEIGHT))
    sheet.save(options.out, quality=82)


if __name__ == "__main__":
    main()
