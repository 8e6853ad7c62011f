"""What readers of photographs compute with pixels: two classes, CIE Lab, other sizes."""

from __future__ import annotations

import numpy as np
from scipy import ndimage

from orbiflow.arrays import Array

BINS = 256
"""Bins of the histogram in which two classes are told apart."""

SRGB_KNEE, SRGB_SLOPE, SRGB_SHIFT, SRGB_POWER = 0.04045, 12.92, 0.055, 2.4
"""The curve of sRGB (IEC 61966-2-1)."""

TO_XYZ = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
"""From linear red, green and blue to CIE XYZ."""

WHITE = np.array([0.95047, 1.0, 1.08883])
"""XYZ of the white of daylight, D65."""

LAB_KNEE = (6 / 29) ** 3
"""Share of white below which CIE Lab is linear."""


def threshold_of(values: Array) -> float:
    """Return the value that parts others into two classes of the least variance (Otsu, 1979)."""
    counts, edges = np.histogram(values, bins=BINS)
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
    share = linear @ TO_XYZ.T / WHITE
    straight = share / (3 * (6 / 29) ** 2) + 4 / 29
    x, y, z = np.moveaxis(np.where(share > LAB_KNEE, np.cbrt(share), straight), -1, 0)
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def resized(values: Array, size: tuple[int, ...]) -> Array:
    """Return pixels (H, W, ...) in another height and width: linear between them, averaged if fewer."""
    factors = np.array(values.shape[:2]) / size[:2]
    rest = [0.0] * (values.ndim - 2)
    if (factors > 1).any():
        blur = [*np.maximum(0, (factors - 1) / 2), *rest]
        values = ndimage.gaussian_filter(values, blur, mode="mirror")
    zoom = [*(1 / factors), *(1.0 for _ in rest)]
    return np.asarray(ndimage.zoom(values, zoom, order=1, mode="mirror", grid_mode=True))
