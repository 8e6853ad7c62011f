"""Small pictures of densities without axes, for pages of many.

In two dimensions they show the canonical square, or a map of directions; of one angle the data's
histogram and the density; of a few angles every pair of samples, and each alone; of many a stripe for
each.
"""

from __future__ import annotations

import io
import math
from itertools import pairwise

import numpy as np
import torch
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw

from orbiflow.arrays import Array
from orbiflow.density.models import Density
from orbiflow.density.pictures.colours import COLOURS
from orbiflow.density.pictures.figures import plane_ground
from orbiflow.density.pictures.frames import view_of
from orbiflow.density.pictures.maps import Map
from orbiflow.density.pictures.projections import chosen_map
from orbiflow.density.pictures.settings import PlotSettings

SIZE = (360, 240)
"""Width and height in pixels, half as many again as a page shows."""

PAPER, INK, BARS = "#ffffff", "#1a1a1a", "#b9c4d0"
COARSE = 120
"""Points along a side at which a density is evaluated; pixels between them are interpolated."""

MAP_PLACES = 14_000
SAMPLES, SEED = 4_000, 0
MAX_PAIRS = 6
"""Number of angles up to which pairs are drawn, instead of stripes."""

MARGIN = 6


@torch.no_grad()
def density_thumbnail(density: Density, data: ArrayLike) -> bytes:
    """Return a PNG of 360 x 240 pixels, the same every time.

    Colours are by logarithms where most of the picture would be dark otherwise. `data` (N, k) are those
    that the density was fitted to; rows that lack angles are left out.
    """
    space, table = density.space, np.asarray(data, dtype=np.float64)
    whole = table[~np.isnan(table).any(axis=1)]
    if not space.has_chart:
        drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(SEED)).numpy()
        picture = (
            _pairs((drawn + 1) / 2) if len(drawn[0]) <= MAX_PAIRS else _stripes((drawn + 1) / 2)
        )
    elif space.dim == 2:
        picture = _plane(density, whole)
    elif space.dim == 1 and space.has_square:
        picture = _histogram(density, whole)
    else:
        drawn = density.sample((SAMPLES,), torch.Generator().manual_seed(SEED))
        places = view_of(space).places(drawn)
        if not space.has_square:
            places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
        picture = _pairs(places) if space.dim <= MAX_PAIRS else _stripes(places)
    sheet = Image.new("RGB", SIZE, PAPER)
    sheet.paste(picture, ((SIZE[0] - picture.width) // 2, (SIZE[1] - picture.height) // 2))
    out = io.BytesIO()
    sheet.save(out, "PNG", optimize=True)
    return out.getvalue()


def _coloured(places: Array) -> Image.Image:
    """Return an image of places (rows, columns) on the colour bar, the first row on top."""
    from matplotlib import colormaps

    shades = colormaps[COLOURS](np.clip(places, 0, 1))[..., :3]
    return Image.fromarray((255 * shades + 0.5).astype(np.uint8), "RGB")


def _plane(density: Density, data: Array) -> Image.Image:
    """Draw the canonical square, a lattice's cell, or a map that suits data (N, k)."""
    space, settings = density.space, PlotSettings()
    if space.is_round:
        ground = Map(space, chosen_map(space, space.to_chart(data)))
        colours = ground.colouring(density, settings, MAP_PLACES)
    else:
        ground = plane_ground(space, settings)
        colours = ground.colouring(density, settings, COARSE)
    left, right, below, above = colours.extent
    scale = min((SIZE[0] - MARGIN) / (right - left), (SIZE[1] - MARGIN) / (above - below))
    size = (round(scale * (right - left)), round(scale * (above - below)))
    picture = _coloured(colours.places[::-1]).resize(size, Image.Resampling.BICUBIC)
    if ground.outline is None:
        return picture
    ring = (ground.outline - (left, above)) * (scale, -scale)
    # four times finer, so that the outline is a curve
    mask = Image.new("L", (4 * size[0], 4 * size[1]))
    ImageDraw.Draw(mask).polygon([tuple(place) for place in (4 * ring).tolist()], fill=255)
    paper = Image.new("RGB", size, PAPER)
    paper.paste(picture, mask=mask.resize(size, Image.Resampling.BOX))
    return paper


def _histogram(density: Density, data: Array) -> Image.Image:
    """Draw bars of the data under the density's line, from minus half a turn to half a turn."""
    space, view, fine = density.space, view_of(density.space), 4
    width, height = (fine * (side - 2 * MARGIN) for side in SIZE)
    bins = min(72, max(12, round(2 * len(data) ** (1 / 3))))
    bars, _ = np.histogram(view.places(space.to_chart(data))[:, 0], bins, (0, 1), density=True)
    t = (torch.arange(width, dtype=torch.float64)[:, None] + 0.5) / width
    line = density.log_prob(view.to_chart(t), measure="square").exp().numpy()
    top = 1.05 * min(max(float(bars.max()), float(line.max())), 4 * float(bars.max()))
    picture = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(picture)
    edges = np.linspace(0, width, bins + 1)
    for (left, right), bar in zip(pairwise(edges.tolist()), bars.tolist(), strict=True):
        draw.rectangle((left + fine / 2, height * (1 - bar / top), right - fine / 2, height), BARS)
    heights: list[float] = (height * (1 - np.minimum(line / top, 1.0))).tolist()
    draw.line(list(enumerate(heights)), INK, width=2 * fine)
    return picture.resize((width // fine, height // fine), Image.Resampling.BOX)


def _pairs(places: Array) -> Image.Image:
    """Draw every pair of angles below the diagonal, each alone on it."""
    count = places.shape[1]
    side = SIZE[1] // count
    sheet = Image.new("RGB", (side * count, side * count), PAPER)
    for row, column in zip(*np.tril_indices(count), strict=True):
        cell = (_bars if row == column else _pair)(places[:, [column, row]], side - 3)
        sheet.paste(cell, (int(side * column + 1), int(side * row + 1)))
    return sheet


def _pair(places: Array, side: int) -> Image.Image:
    bins = max(12, side // 3)
    counts, _ = np.histogramdd(places, (bins, bins), ((0, 1), (0, 1)))
    shade = counts / max(1.0, float(np.quantile(counts, 0.995)))
    # a square root: most cells of many angles are nearly empty
    return _coloured(np.sqrt(shade).T[::-1]).resize((side, side), Image.Resampling.BICUBIC)


def _bars(places: Array, side: int) -> Image.Image:
    counts, _ = np.histogram(places[:, 0], side // 2, (0, 1))
    picture = Image.new("RGB", (side, side), PAPER)
    draw = ImageDraw.Draw(picture)
    for k, bar in enumerate((counts / max(1, counts.max())).tolist()):
        draw.rectangle((2 * k, side * (1 - 0.95 * bar), 2 * k + 1, side), BARS)
    return picture


def _stripes(places: Array) -> Image.Image:
    """Draw a stripe for each angle, from the top, each as bright as its largest bin."""
    counts = [np.histogram(column, 90, (0, 1))[0] for column in places.T]
    shades = np.stack([count / max(1, count.max()) for count in counts])
    height = max(1, math.floor(SIZE[1] / len(shades)))
    picture = _coloured(shades).resize((SIZE[0], height * len(shades)), Image.Resampling.BOX)
    draw = ImageDraw.Draw(picture)
    for k in range(1, len(shades) if height > 6 else 0):
        draw.line((0, k * height, SIZE[0], k * height), PAPER)
    return picture
