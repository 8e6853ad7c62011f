"""Photographs: the shape and the background are distinguished by colour, and its shadow is background.

Colours are CIE Lab, with lightness counted from -16: a shadow then scales all three coordinates by
one factor, its gain, so that a background in shadow lies on the ray from the origin to its colour.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.tiles.silhouette.readers.colour_models import ColourCut, middle_of

SEARCH_SIDE_PIXELS = 400  # the shape is found at this size, its edge in the picture itself
LUMINANCE = np.array([0.299, 0.587, 0.114])  # of red, green and blue, as Pillow weighs them
FLAT_SPREAD = 8.0  # in CIE Lab: one ink or one paper differs less from itself
MAX_SHARE_NOT_FLAT = 0.02  # of the pixels of a drawing in two colours, edges apart
CUT_SIDE_PIXELS = 320  # colour models are fitted at this size
SHARP_SHARE = 0.7  # of the sharpest outline's slope: a duller one is no shape's
MIN_SLOPE = 2.0  # in CIE Lab a pixel: so steep is a shape's outline
SAME_SHAPE = 0.8  # IoU of two shapes from which on they are one: the first knows shadows
MARGIN_SHARE = 0.03  # of the shorter side: the border, which is background
QUANTILES = (0.1, 0.3, 0.5, 0.7, 0.9)  # of a background's colours, which are parted around them
MIN_COLOUR_SHARE = 0.02  # of the background: rarer colours are none of its own
MIN_SPREAD = 2.0  # in CIE Lab: the least spread of a background's colours
MAX_SIGMAS = 8.0  # standard deviations: nothing is farther from a background
GAINS = np.arange(1, 0.45, -0.05)
DEEPEST_GAINS = (1.0, 0.8, 0.65, 0.5)  # gains of the deepest shadows that are tried
SHADOW_SIGMAS = 4.0  # standard deviations for a shadow that is black
HISTOGRAM_BINS = 256
"""Bins of the histogram that is divided into two classes."""

SRGB_KNEE, SRGB_SLOPE, SRGB_SHIFT, SRGB_POWER = 0.04045, 12.92, 0.055, 2.4
"""The curve of sRGB (IEC 61966-2-1)."""

TO_XYZ = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
"""From linear red, green and blue to CIE XYZ."""

WHITE_XYZ = np.array([0.95047, 1.0, 1.08883])
"""XYZ of the white of daylight, D65."""

LAB_KNEE = (6 / 29) ** 3
"""Share of white below which CIE Lab is linear."""

FUR_PIXELS = 1.0  # pixels of that picture to which single hairs and grain are averaged
EDGE_PIXELS = 2  # pixels of that picture within which the outline is drawn again

_Mask = NDArray[np.bool_]


def is_photograph(rgb: Array) -> bool:
    """Whether an image (H, W, 3), 0 to 1, has more in it than two flat colours and their edges."""
    grey = rgb @ LUMINANCE
    light = grey > threshold_of(grey)
    flat = scipy.ndimage.maximum_filter(light, 5) == scipy.ndimage.minimum_filter(light, 5)
    lab = _lab(rgb)
    parts = [lab[part] for part in (flat & light, flat & ~light) if part.any()]
    colours = [np.median(part, axis=0) for part in parts]
    if not parts:
        return False
    flatness = min(FLAT_SPREAD, float(np.linalg.norm(colours[0] - colours[-1])) / 4)
    off = [np.linalg.norm(p - c, axis=1) > flatness for p, c in zip(parts, colours, strict=True)]
    return float(np.mean(np.concatenate(off))) > MAX_SHARE_NOT_FLAT


def shape_in(rgb: Array) -> Array:
    """Return how far each pixel belongs to the shape, 0 to 1.

    The background is what the border shows, in a light that varies slowly. Shadows of several
    depths are taken for background; the depth that leaves the sharpest outline is right. Where colour
    models find another shape, from this one or from the middle, theirs is taken.
    """
    scale = min(SEARCH_SIDE_PIXELS / max(rgb.shape), 1)
    size = tuple(round(scale * side) for side in rgb.shape[:2])
    lab = _lab(resized(rgb, size))
    region = _by_colour_models(lab, _sharpest(scipy.ndimage.gaussian_filter(lab, (1, 1, 0))))
    region = resized(region.astype(float), rgb.shape[:2]) > 0.5
    matte = _matte(_lab(rgb), region, round(EDGE_PIXELS / scale))
    return scipy.ndimage.gaussian_filter(matte, FUR_PIXELS / scale)


def _lab(rgb: Array) -> Array:
    return lab_of(rgb) + np.array([16.0, 0.0, 0.0])


def _border(lab: Array) -> _Mask:
    """Return the border of a picture, which is background."""
    margin = max(3, round(MARGIN_SHARE * min(lab.shape[:2])))
    border = np.ones(lab.shape[:2], dtype=bool)
    border[margin:-margin, margin:-margin] = False
    return border


def _by_colour_models(lab: Array, region: _Mask) -> _Mask:
    """Return the region, or the shape of colour models where it is another one."""
    scale = min(CUT_SIDE_PIXELS / max(lab.shape), 1)
    size = tuple(round(scale * side) for side in lab.shape[:2])
    small = resized(lab, size)
    border = _border(small)
    small = small / _light(small[..., 0], border)[..., None]
    start = resized(region.astype(float), size) > 0.5
    cut = ColourCut(scipy.ndimage.gaussian_filter(small, (0.5, 0.5, 0)), border)
    shapes = [cut.shape(mask) for mask in (start, middle_of(size)) if mask.any()]
    slope = _slope(small)
    sharp = [_steepness(slope, shape) for shape in shapes]
    least = max(MIN_SLOPE, SHARP_SHARE * max(sharp))
    kept = [shape for shape, slope in zip(shapes, sharp, strict=True) if slope >= least]
    shape = min(kept, key=cut.cost, default=start)
    both = (shape & start).sum() / max(1, (shape | start).sum())
    return region if both > SAME_SHAPE else resized(shape.astype(float), lab.shape[:2]) > 0.5


def _slope(lab: Array) -> Array:
    """Return how steeply colours change about each pixel."""
    slopes = [scipy.ndimage.gaussian_gradient_magnitude(band, 1) for band in np.moveaxis(lab, 2, 0)]
    return scipy.ndimage.maximum_filter(np.linalg.norm(slopes, axis=0), 3)


def _sharpest(lab: Array) -> _Mask:
    """Return the region with the sharpest outline."""
    border = _border(lab)
    surprise = _surprise(lab, border)
    slope = _slope(lab)
    regions = [_differing(surprise, deepest, border) for deepest in DEEPEST_GAINS]
    large = [region for region in regions if 3 * region.sum() >= regions[0].sum()]
    return max(large, key=lambda region: _steepness(slope, region))


def _steepness(slope: Array, region: _Mask) -> float:
    """Return the slope that three quarters of a region's outline exceed."""
    if not region.any():
        return 0.0
    return float(
        np.quantile(slope[region & ~scipy.ndimage.binary_erosion(region, border_value=1)], 0.25)
    )


def _surprise(lab: Array, background: _Mask) -> Array:
    """Return squared distances (gains, H, W) from the background, in its standard deviations."""
    lab = lab / _light(lab[..., 0], background)[..., None]
    colours = lab[background]
    label, _ = scipy.cluster.vq.vq(colours, np.quantile(colours, QUANTILES, axis=0))
    distances: list[Array] = []
    for colour in (colours[label == k] for k in range(len(QUANTILES))):
        if len(colour) > MIN_COLOUR_SHARE * len(colours):
            root = np.linalg.cholesky(np.linalg.inv(np.cov(colour.T) + MIN_SPREAD**2 * np.eye(3)))
            apart = lab / GAINS[:, None, None, None] - colour.mean(axis=0)
            distances.append(np.sum((apart @ root) ** 2, axis=3))
    return np.min(distances, axis=0)


def _light(lightness: Array, background: _Mask) -> Array:
    """Return the light, 1 on average, as a quadratic function of place fitted to the background."""
    x, y = np.meshgrid(*(np.linspace(-1, 1, n) for n in lightness.shape[::-1]))
    terms = np.stack([x**i * y**j for i in range(3) for j in range(3 - i)], axis=-1)
    fit = terms @ np.linalg.lstsq(terms[background], lightness[background], rcond=None)[0]
    fit = np.maximum(fit, 0.1 * fit.max())
    return fit / fit.mean()


def _differing(surprise: Array, deepest: float, border: _Mask) -> _Mask:
    """Return where no background is, in shadows up to the deepest."""
    shadows = deepest - 0.01 < GAINS
    cost = SHADOW_SIGMAS * (1 - GAINS[shadows, None, None])
    far = np.sqrt(np.min(surprise[shadows] + cost**2, axis=0))
    far = scipy.ndimage.gaussian_filter(np.minimum(far, MAX_SIGMAS), 0.7)
    split = far > threshold_of(far)
    level = (np.median(far[split]) + np.median(far[~split])) / 2
    return far > max(level, 1.2 * np.quantile(far[border], 0.95))


def _matte(lab: Array, region: _Mask, width: int) -> Array:
    """Return 1 inside and 0 outside; near the edge, where a colour lies between those on both sides."""
    inside = scipy.ndimage.binary_erosion(region, iterations=width, border_value=1)
    outside = ~scipy.ndimage.binary_dilation(region, iterations=width)
    shape, ground = (_average(lab, part, 2 * width) for part in (inside, outside))
    apart = shape - ground
    share = np.sum((lab - ground) * apart, axis=2) / (np.sum(apart**2, axis=2) + 1e-9)
    return np.where(inside, 1.0, np.where(outside, 0.0, np.clip(share, 0, 1)))


def _average(lab: Array, part: _Mask, width: int) -> Array:
    """Return the colours of a part, averaged and carried on beyond it."""
    weights = part.astype(float)[..., None]
    total = scipy.ndimage.gaussian_filter(weights, (width, width, 0)) + 1e-9
    return scipy.ndimage.gaussian_filter(lab * weights, (width, width, 0)) / total


def threshold_of(values: Array) -> float:
    """Return the value that parts others into two classes of the least variance (Otsu, 1979)."""
    counts, edges = np.histogram(values, bins=HISTOGRAM_BINS)
    centers = (edges[:-1] + edges[1:]) / 2
    below, above = np.cumsum(counts), np.cumsum(counts[::-1])[::-1]
    sums = np.cumsum(counts * centers)
    mean_below = sums / np.maximum(below, 1)
    mean_above = np.cumsum((counts * centers)[::-1])[::-1] / np.maximum(above, 1)
    between = below[:-1] * above[1:] * (mean_below[:-1] - mean_above[1:]) ** 2
    return float(centers[int(np.argmax(between))])


def lab_of(rgb: Array) -> Array:
    """Return CIE Lab (..., 3) of sRGB (..., 3) from 0 to 1: lightness from 0 to 100, and two hues.

    >>> lab_of(np.array([1.0, 1.0, 1.0])).round(1).tolist()
    [100.0, -0.0, 0.0]
    """
    bent = ((rgb + SRGB_SHIFT) / (1 + SRGB_SHIFT)) ** SRGB_POWER
    linear = np.where(rgb > SRGB_KNEE, bent, rgb / SRGB_SLOPE)
    share = linear @ TO_XYZ.T / WHITE_XYZ
    straight = share / (3 * (6 / 29) ** 2) + 4 / 29
    x, y, z = np.moveaxis(np.where(share > LAB_KNEE, np.cbrt(share), straight), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def resized(values: Array, size: tuple[int, ...]) -> Array:
    """Return pixels (H, W, ...) in another height and width: linear between them, averaged if fewer."""
    factors = np.array(values.shape[:2]) / size[:2]
    rest = [0.0] * (values.ndim - 2)
    if (factors > 1).any():
        blur = [*np.maximum(0, (factors - 1) / 2), *rest]
        values = scipy.ndimage.gaussian_filter(values, blur, mode="mirror")
    zoom = [*(1 / factors), *(1.0 for _ in rest)]
    return np.asarray(scipy.ndimage.zoom(values, zoom, order=1, mode="mirror", grid_mode=True))
