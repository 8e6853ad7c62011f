"""Photographs: the shape is told from the background by colour, and its shadow is background.

Colours are CIE Lab, with lightness counted from -16: a shadow then scales all three coordinates by
one factor, its gain, so that a background in shadow lies on the ray from the origin to its colour.
"""

import warnings

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.cluster.vq import kmeans2
from skimage.color import rgb2lab
from skimage.filters import threshold_otsu
from skimage.transform import resize

from orbiflow.arrays import Array

SIDE = 400  # pixels: the shape is found in a picture of this size, its edge in the picture itself
LUMINANCE = np.array([0.299, 0.587, 0.114])  # of red, green and blue, as Pillow weighs them
FLAT = 8.0  # in CIE Lab: one ink or one paper differs less from itself
MAX_SHARE_NOT_FLAT = 0.02  # of the pixels of a drawing in two colours, edges apart
MARGIN = 0.03  # of the shorter side: the border, which is background
COLOURS = 5  # of a background
GRAIN = 2.0  # in CIE Lab: colours of a background are not told apart more finely
FAR = 8.0  # standard deviations: nothing is farther from a background
GAINS = np.arange(1, 0.45, -0.05)
DEEPEST = (1.0, 0.8, 0.65, 0.5)  # gains of the deepest shadows that are tried
DEPTH_COST = 4.0  # standard deviations for a shadow that is black
EDGE_WIDTH = 2  # pixels of that picture within which the outline is drawn again

_Mask = NDArray[np.bool_]


def is_photograph(rgb: Array) -> bool:
    """Whether an image (H, W, 3), 0 to 1, has more in it than two flat colours and their edges."""
    grey = rgb @ LUMINANCE
    if np.ptp(rgb) == 0:
        return False
    light = grey > (threshold_otsu(grey) if np.ptp(grey) > 0 else 1)
    flat = ndimage.maximum_filter(light, 5) == ndimage.minimum_filter(light, 5)
    lab = _lab(rgb)
    parts = [lab[part] for part in (flat & light, flat & ~light) if part.any()]
    colours = [np.median(part, axis=0) for part in parts]
    if not parts:
        return False
    flatness = min(FLAT, float(np.linalg.norm(colours[0] - colours[-1])) / 4)
    off = [np.linalg.norm(p - c, axis=1) > flatness for p, c in zip(parts, colours, strict=True)]
    return float(np.mean(np.concatenate(off))) > MAX_SHARE_NOT_FLAT


def shape_in(rgb: Array) -> tuple[Array, float]:
    """Return how far each pixel belongs to the shape, 0 to 1, and how steep colours are at its edge.

    The background is what the border shows, in a light that varies slowly. Shadows of several
    depths are taken for background; the depth that leaves the sharpest outline is right.
    """
    scale = min(SIDE / max(rgb.shape), 1)
    size = tuple(round(scale * side) for side in rgb.shape[:2])
    lab = _lab(resize(rgb, size, anti_aliasing=scale < 1))
    region, steepness = _sharpest(ndimage.gaussian_filter(lab, (1, 1, 0)))
    region = resize(region.astype(float), rgb.shape[:2]) > 0.5
    return _matte(_lab(rgb), region, round(EDGE_WIDTH / scale)), steepness


def _lab(rgb: Array) -> Array:
    return rgb2lab(rgb) + np.array([16.0, 0.0, 0.0])


def _sharpest(lab: Array) -> tuple[_Mask, float]:
    """Return the region with the sharpest outline, and its steepness in CIE Lab for each pixel."""
    margin = max(3, round(MARGIN * min(lab.shape[:2])))
    border = np.ones(lab.shape[:2], dtype=bool)
    border[margin:-margin, margin:-margin] = False
    surprise = _surprise(lab, border)
    slopes = [ndimage.gaussian_gradient_magnitude(band, 1) for band in np.moveaxis(lab, 2, 0)]
    slope = ndimage.maximum_filter(np.linalg.norm(slopes, axis=0), 3)
    regions = [_differing(surprise, deepest, border) for deepest in DEEPEST]
    steep = [_steepness(slope, region, regions[0]) for region in regions]
    best = int(np.argmax(steep))
    return regions[best], steep[best]


def _steepness(slope: Array, region: _Mask, whole: _Mask) -> float:
    """Return the slope that three quarters of a region's outline exceed."""
    if 3 * region.sum() < whole.sum() or not region.any():
        return 0.0
    return float(np.quantile(slope[region & ~ndimage.binary_erosion(region, border_value=1)], 0.25))


def _surprise(lab: Array, background: _Mask) -> Array:
    """Return squared distances (gains, H, W) from the background, in its standard deviations."""
    lab = lab / _light(lab[..., 0], background)[..., None]
    colours = lab[background]
    middle = np.quantile(colours, np.linspace(0.1, 0.9, COLOURS), axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a background may have fewer colours
        label = kmeans2(colours, middle, minit="matrix")[1]
    clusters = [colours[label == i] for i in range(COLOURS)]
    clusters = [part for part in clusters if len(part) > 0.02 * len(colours)]
    return np.min([_squared_distance(lab, part) for part in clusters], axis=0)


def _squared_distance(lab: Array, cluster: Array) -> Array:
    """Return those from one colour of the background, with each gain undone."""
    root = np.linalg.cholesky(np.linalg.inv(np.cov(cluster.T) + GRAIN**2 * np.eye(3)))
    scaled, middle = lab @ root, cluster.mean(axis=0) @ root
    return np.stack([np.sum((scaled / gain - middle) ** 2, axis=2) for gain in GAINS])


def _light(lightness: Array, background: _Mask) -> Array:
    """Return the light, 1 on average, as a quadratic function of place fitted to the background."""
    x, y = np.meshgrid(*(np.linspace(-1, 1, n) for n in lightness.shape[::-1]))
    terms = np.stack([x**i * y**j for i in range(3) for j in range(3 - i)], axis=-1)
    weights, fit = background.astype(float), lightness
    for _ in range(4):
        sides = terms[background] * weights[background, None], (lightness * weights)[background]
        fit = terms @ np.linalg.lstsq(*sides, rcond=None)[0]
        off = np.abs(lightness - fit)
        weights = 1 / np.maximum(1, off / (3 * np.median(off[background]) + 1))
    fit = np.maximum(fit, 0.1 * fit.max())
    return fit / fit.mean()


def _differing(surprise: Array, deepest: float, border: _Mask) -> _Mask:
    """Return where no background is, in shadows up to the deepest."""
    shadows = deepest - 0.01 < GAINS
    cost = DEPTH_COST * (1 - GAINS[shadows, None, None])
    far = np.sqrt(np.min(surprise[shadows] + cost**2, axis=0))
    far = ndimage.gaussian_filter(np.minimum(far, FAR), 0.7)
    split = far > threshold_otsu(far)
    level = (np.median(far[split]) + np.median(far[~split])) / 2
    return far > max(level, 1.2 * np.quantile(far[border], 0.95))


def _matte(lab: Array, region: _Mask, width: int) -> Array:
    """Return 1 inside and 0 outside; near the edge, where a colour lies between those on both sides."""
    inside = ndimage.binary_erosion(region, iterations=width, border_value=1)
    outside = ~ndimage.binary_dilation(region, iterations=width)
    shape, ground = (_average(lab, part, 2 * width) for part in (inside, outside))
    apart = shape - ground
    share = np.sum((lab - ground) * apart, axis=2) / (np.sum(apart**2, axis=2) + 1e-9)
    return np.where(inside, 1.0, np.where(outside, 0.0, np.clip(share, 0, 1)))


def _average(lab: Array, part: _Mask, width: int) -> Array:
    """Return the colours of a part, averaged and carried on beyond it."""
    weights = part.astype(float)[..., None]
    total = ndimage.gaussian_filter(weights, (width, width, 0)) + 1e-9
    return ndimage.gaussian_filter(lab * weights, (width, width, 0)) / total
