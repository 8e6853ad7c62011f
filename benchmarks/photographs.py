"""How well animals are read from photographs: synthetic ones, whose true silhouettes are known.

    python benchmarks/photographs.py [--scenes 24] [--seed 0] [--out FOLDER]

Each scene has a silhouette with fur, spots and shading, a background with grain and uneven light, a
shadow, noise of a sensor and JPEG. The table has the overlap (IoU) of what is read with the truth, by
default and by one level of luminance (Otsu's), which is how version 0.1 read photographs. In FOLDER
each picture is written with the outline that was read, to be looked at.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

import numpy as np
from common import BUNDLED
from numpy.typing import NDArray
from PIL import Image, ImageDraw
from scipy import ndimage
from skimage.filters import threshold_otsu

from orbiflow.errors import OrbiflowError
from orbiflow.tiles import Target

Field = NDArray[np.float64]

LONG, MARGIN = 560, 150
"""Pixels of the longer side of a silhouette, and around it."""

LEAST_CONTRAST = 0.25
"""Least distance of the colours of animal and background, where black and white are 1.7 apart."""


def drawn(ring: Field, shape: tuple[int, ...]) -> Field:
    """Return what a ring (N, 2) in pixels covers, from 0 to 1, in a picture (height, width)."""
    picture = Image.new("L", (3 * shape[1], 3 * shape[0]))
    ImageDraw.Draw(picture).polygon([(3 * x, 3 * y) for x, y in ring.tolist()], fill=255)
    return np.asarray(picture.reduce(3), dtype=float) / 255


def silhouette(path: Path) -> Field:
    """Return the cover of the silhouette in a file, with room about it."""
    ring = Target.read(path).normal * [1, -1]
    ring = (ring - ring.min(axis=0)) * LONG / np.ptp(ring, axis=0).max() + MARGIN
    width, height = (ring.max(axis=0) + MARGIN).astype(int)
    return drawn(ring, (height, width))


class Scene:
    """A photograph of a silhouette, by a seed."""

    def __init__(self, cover: Field, rng: np.random.Generator) -> None:
        self.cover, self.rng, self.shape = cover, rng, cover.shape
        fur, ground = self._colours()
        animal = fur * (1 + 0.1 * self._cloud(2, 5) + 0.1 * self._cloud(30)) * self._shading()
        if rng.uniform() < 0.3:
            animal = np.where(self._cloud(25) > 1, self._colours()[0], animal)
        y, x = np.mgrid[: self.shape[0], : self.shape[1]][..., None] / max(self.shape) - 0.5
        light = 1 + 0.25 * (rng.normal() * x + rng.normal() * y)
        floor = ground * (1 + 0.03 * self._cloud(12) + 0.03 * self._cloud(1)) * light
        floor *= 1 - rng.uniform(0.2, 0.5) * self._shadow()[..., None]
        self.colours = floor + (animal - floor) * cover[..., None]

    def jpeg(self) -> bytes:
        """Return the photograph."""
        noise = self.rng.normal(size=self.colours.shape) * 0.015
        pixels = (255 * np.clip(self.colours + noise, 0, 1)).astype(np.uint8)
        file = io.BytesIO()
        Image.fromarray(pixels).save(file, "JPEG", quality=int(self.rng.choice([45, 60, 80])))
        return file.getvalue()

    def _colours(self) -> tuple[Field, Field]:
        """Return two colours that can be told apart."""
        while True:
            fur, ground = self.rng.uniform(0.1, 0.95, (2, 3))
            ground += 0.6 * (ground.mean() - ground)  # rooms and meadows are duller than animals
            if np.linalg.norm(fur - ground) > LEAST_CONTRAST:
                return fur, ground

    def _cloud(self, width: float, height: float | None = None) -> Field:
        """Return smooth noise (H, W, 1) of deviation 1."""
        grain = self.rng.normal(size=self.shape)
        smooth = ndimage.gaussian_filter(grain, (height or width, width))
        return (smooth / smooth.std())[..., None]

    def _shading(self) -> Field:
        return np.linspace(1.1, 0.75, self.shape[0])[:, None, None]

    def _shadow(self) -> Field:
        """Return the darkness of a shadow: beside the animal, or lying before its feet."""
        squash, lean = (
            (1.0, 0.0) if self.rng.uniform() < 0.5 else (2.2, self.rng.uniform(-0.8, 0.8))
        )
        feet = np.array([np.nonzero(self.cover.max(axis=1))[0].max(), self.shape[1] / 2])
        turn = np.array([[squash, 0], [lean, 1]])
        fallen = ndimage.affine_transform(self.cover, turn, feet - turn @ feet, order=1)
        moved = ndimage.shift(fallen, self.rng.uniform((5, -30), (25, 30)), order=1)
        return np.clip(ndimage.gaussian_filter(moved, self.rng.uniform(3, 14)), 0, 1)


def overlap(truth: Field, read: Field) -> float:
    """Return the IoU of two covers."""
    one, two = truth > 0.5, read > 0.5
    return float((one & two).sum() / (one | two).sum())


def by_luminance(photograph: bytes) -> Field:
    """Return the largest part on the side of Otsu's level that the border is not on."""
    grey = np.asarray(Image.open(io.BytesIO(photograph)).convert("L"), dtype=float)
    dark = grey < threshold_otsu(grey)
    border = np.concatenate([dark[0], dark[-1], dark[:, 0], dark[:, -1]])
    parts, _ = ndimage.label(~dark if border.mean() > 0.5 else dark)
    largest = np.bincount(parts.flat)[1:].argmax() + 1
    return ndimage.binary_fill_holes(parts == largest).astype(float)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--scenes", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    files = [p for p in sorted(BUNDLED.rglob("*")) if p.suffix in (".dat", ".svg", ".png")]
    found: list[tuple[float, float]] = []
    print(f"{'scene':>5}  {'silhouette':<16} {'read':>6} {'by luminance':>13}")
    for number in range(given.scenes):
        path = files[number % len(files)]
        cover = silhouette(path)
        photograph = Scene(cover, np.random.default_rng([given.seed, number])).jpeg()
        try:
            ring = Target.from_bytes(photograph, "photograph.jpg").outline
            own = overlap(cover, drawn(ring, cover.shape))
        except OrbiflowError:
            ring, own = np.zeros((0, 2)), 0.0
        found.append((own, overlap(cover, by_luminance(photograph))))
        print(f"{number:>5}  {path.stem:<16} {own:6.3f} {found[-1][1]:13.3f}")
        if given.out:
            given.out.mkdir(parents=True, exist_ok=True)
            picture = Image.open(io.BytesIO(photograph))
            if len(ring):
                closed = [tuple(point) for point in (*ring, ring[0])]
                ImageDraw.Draw(picture).line(closed, fill=(255, 0, 200), width=4)
            picture.save(given.out / f"{number:02}.png")
    table = np.array(found)
    for name, line in (("mean", table.mean(axis=0)), ("least", table.min(axis=0))):
        print(f"{name:>5}  {'':<16} {line[0]:6.3f} {line[1]:13.3f}")


if __name__ == "__main__":
    main()
