"""Dots: points over a density, which they leave readable, or on a light ground."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.pictures.axes import INK
from orbiflow.drawing import Sheet

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MAX_DOTS = 3000

COVER = 0.3
"""Of the area about a dot that dots may hide of a density."""

NEAREST = 8
"""Other dots by whose distance it is told how crowded a place is."""

LEAST = 0.5
"""Points across of the smallest dot on a screen; those that should be smaller are fainter instead."""

STEP = 1.1
"""From one size of dots to the next."""

FAINTEST = 0.03
"""Of a dot's ink."""


class Dots(NamedTuple):
    """Where dots are (N, k), each place once, and how wide (N,) they may be."""

    places: Array
    widths: Array


def roomy(points: Array) -> Dots:
    """Widths of dots at points (N, k) of a plane or surface, in their unit, that hide `COVER` of it.

    Points at one place are one dot, or they would be smaller and fainter for being many.

    >>> even = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0)), axis=-1).reshape(-1, 2)
    >>> round(float(np.median(roomy(even).widths)), 1)
    0.5
    """
    from scipy.spatial import cKDTree

    _, first = np.unique(points.round(9), axis=0, return_index=True)
    places = points[np.sort(first)]
    nearest = min(NEAREST, len(places) - 1)
    if nearest < 1:
        return Dots(places, np.full(len(places), np.inf))
    far = np.asarray(cKDTree(places).query(places, [nearest + 1])[0]).ravel()
    # a disc of this radius holds so many others and the dot itself
    return Dots(places, 2 * far * np.sqrt(COVER / (nearest + 1)))


def draw_dots_over(
    axes: Axes, points: Array, inches: float, *, limit: int = MAX_DOTS, shrink: float = 1.0
) -> None:
    """Points (N, 2) as dots over a density, at most `limit` of them, smaller where they crowd.

    Where they crowd the density is high, and its peaks are what a picture is of.

    Args:
        inches: of the figure that a unit of the axes takes.
        shrink: what to multiply the dots' area by.
    """
    chosen = thinned(points, limit)
    most, shrink = _largest(len(chosen), shrink)
    dots = roomy(chosen)
    steps = np.ceil(np.log(most / (72 * inches * dots.widths).clip(1e-9, most)) / math.log(STEP))
    # one collection a size: a PDF or SVG holds its circle once
    for step in np.unique(steps):
        wanted = most * STEP**-step
        width = max(wanted, min(LEAST * shrink**0.5, most))
        ink = max((wanted / width) ** 2, FAINTEST)
        axes.scatter(
            *dots.places[steps == step].T, s=width**2, c="#ffffff", edgecolors=INK,
            linewidths=0.12 * width, alpha=0.8 * ink, zorder=5, rasterized=len(chosen) > MAX_DOTS,
        )  # fmt: skip


def draw_dots(
    axes: Axes,
    points: Array,
    alpha: float,
    *,
    fill: str,
    limit: int = MAX_DOTS,
    shrink: float = 1.0,
    rasterized: bool = False,
) -> None:
    """Points (N, 2) as dots of one size on a ground of one colour, at most `limit` of them.

    Args:
        shrink: what to multiply the dots' area by.
        rasterized: whether they are pixels in a PDF or SVG, too; more than `MAX_DOTS` always are.
    """
    points = thinned(points, limit)
    width, _ = _largest(len(points), shrink)
    axes.scatter(
        *points.T, s=width**2, c=fill, edgecolors="none", alpha=alpha, zorder=5,
        rasterized=rasterized or len(points) > MAX_DOTS,
    )  # fmt: skip


def _largest(count: int, shrink: float) -> tuple[float, float]:
    """Points across of the largest of so many dots, and their area's factor."""
    shrink = max(shrink / max(1.0, count / MAX_DOTS) ** 0.7, 0.04)
    return (shrink * max(2.0, 9.0 - count / 500)) ** 0.5, shrink


def thinned(points: Array, limit: int = MAX_DOTS) -> Array:
    """A random choice of at most `limit` of points (N, d), always the same."""
    if len(points) <= limit:
        return points
    return points[np.random.default_rng(0).choice(len(points), limit, replace=False)]


def dot_shrink(sheet: Sheet, side: float) -> float:
    """Of dots in a square of so many inches: those on a screen have one of 5.6."""
    return max(0.2, (side / 5.6) ** 2) if sheet.printed else 1.0
