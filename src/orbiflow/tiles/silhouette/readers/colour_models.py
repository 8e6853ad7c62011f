"""Shape and background of a photograph as mixtures of colours, parted along the shortest outline.

GrabCut (Rother, Kolmogorov and Blake, 2004): colour models of both parts, and the parts that they
imply, are found in turn. The cut of least cost is that of its convex relaxation (Chan, Esedoglu and
Nikolova, 2006), found by primal-dual steps (Chambolle and Pock, 2011).
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy
from numpy.typing import NDArray

from orbiflow.arrays import Array

COLOURS = 5
"""Normal distributions in the mixture of a part's colours."""

LEAST_SPREAD = 2.0
"""Least standard deviation of a colour, in CIE Lab."""

LEAST_PIXELS = 8
"""Pixels of a colour: fewer are none of their own."""

EDGE_COST = 30.0
"""What a pixel of outline costs where neighbours have one colour, in nats."""

MOST_COST = 20.0
"""Nats by which one part may explain a pixel better than the other, at most."""

SURE_COST = 60.0
"""Nats by which what is surely background is."""

ROUNDS, STEPS = 10, 50
"""How often the models are fitted anew, at most, and the steps towards the cut each time."""

STEP = 8**-0.5
"""Length of steps, at which they converge: the norm of differences is at most the root of 8."""

MIDDLE_SHARE = 0.3
"""Half axes of the ellipse in the middle from which a cut begins, as shares of the sides."""

_Mask = NDArray[np.bool_]


class ColourModel:
    """A mixture of normal distributions of colours (n, 3), each as often as it is the nearest."""

    def __init__(self, colours: Array, labels: NDArray[np.integer]) -> None:
        self._parts: list[tuple[float, Array, Array]] = []
        for label in range(COLOURS):
            members = colours[labels == label]
            if len(members) >= LEAST_PIXELS:
                spread = np.cov(members.T) + LEAST_SPREAD**2 * np.eye(3)
                root = np.linalg.cholesky(np.linalg.inv(spread))
                weight = np.log(len(members) / len(colours)) + np.log(np.diag(root)).sum()
                self._parts.append((float(weight), members.mean(axis=0), root))

    def costs(self, colours: Array) -> Array:
        """Return minus the log density (k, n) of colours (n, 3) by each part, but for a constant."""
        return np.stack(
            [
                0.5 * np.sum(((colours - mean) @ root) ** 2, axis=1) - w
                for w, mean, root in self._parts
            ]
        )

    @classmethod
    def fitted(cls, colours: Array, rounds: int = 1) -> ColourModel:
        """Return the model of colours (n, 3), which begins with k-means."""
        generator = np.random.default_rng(0)
        count = min(COLOURS, len(colours))
        with np.errstate(invalid="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of fewer colours than centres some have no pixel
            _, labels = scipy.cluster.vq.kmeans2(
                colours, count, iter=10, minit="++", seed=generator
            )
        model = cls(colours, labels)
        for _ in range(rounds - 1):
            model = cls(colours, model.costs(colours).argmin(axis=0))
        return model


class ColourCut:
    """A photograph of colours (H, W, 3) in CIE Lab whose `border` is surely background."""

    def __init__(self, lab: Array, border: _Mask) -> None:
        self._shape, self._colours, self._border = lab.shape[:2], lab.reshape(-1, 3), border
        apart = [np.sum(np.diff(lab, axis=axis) ** 2, axis=2) for axis in (1, 0)]
        sharpness = 0.5 / (np.mean(np.concatenate([a.ravel() for a in apart])) + 1e-9)
        # the cost of an outline between neighbours side by side, and one above the other
        self._edges = [np.exp(-sharpness * a) for a in apart]

    def shape(self, start: _Mask) -> _Mask:
        """Return the largest connected part of the cut from a start, without its holes."""
        region = self.cut(start)
        labels, count = scipy.ndimage.label(region)
        if not count:
            return region
        largest = 1 + np.argmax(np.bincount(labels.ravel())[1:])
        return scipy.ndimage.binary_fill_holes(labels == largest)

    def cut(self, region: _Mask) -> _Mask:
        """Return the shape that colour models find from a region that is like it.

        A region, or a background, of too few pixels for a model stays as it is.
        """
        if not _have_colours(region):
            return region
        share = region.astype(float)
        along, down = (np.zeros(self._shape) for _ in range(2))
        models = [ColourModel.fitted(self._colours[part.ravel()]) for part in (region, ~region)]
        for _ in range(ROUNDS):
            pull = self._pull(models)
            share = self._relaxed(
                share, np.where(self._border, SURE_COST / EDGE_COST, pull), along, down
            )
            before, region = region, share > 0.5
            if not _have_colours(region) or (region != before).mean() < 1e-4:
                break
            parts = [self._colours[part.ravel()] for part in (region, ~region)]
            models = [
                ColourModel(part, model.costs(part).argmin(axis=0))
                for model, part in zip(models, parts, strict=True)
            ]
        # what reaches the border goes on to the picture's edge
        return region | (self._relaxed(share, self._pull(models), along, down) > 0.5) & self._border

    def _pull(self, models: list[ColourModel]) -> Array:
        """Return by how much the background explains each pixel better, over the cost of an edge."""
        shape, ground = (model.costs(self._colours).min(axis=0) for model in models)
        pull = np.clip(shape - ground, -MOST_COST, MOST_COST) / EDGE_COST
        return pull.reshape(self._shape)

    def _relaxed(self, share: Array, pull: Array, along: Array, down: Array) -> Array:
        """Return shares of 0 to 1 of least cost, from others; `along` and `down` are their duals."""
        beside, above = self._edges
        ahead = share
        for _ in range(STEPS):
            along[:, :-1] += STEP * (ahead[:, 1:] - ahead[:, :-1])
            down[:-1] += STEP * (ahead[1:] - ahead[:-1])
            np.clip(along[:, :-1], -beside, beside, out=along[:, :-1])
            np.clip(down[:-1], -above, above, out=down[:-1])
            spread = along + down
            spread[:, 1:] -= along[:, :-1]
            spread[1:] -= down[:-1]
            moved = np.clip(share + STEP * (spread - pull), 0, 1)
            ahead, share = 2 * moved - share, moved
        return share

    def cost(self, region: _Mask) -> float:
        """Return minus the log density of all colours by both models, and what the outline costs."""
        if not _have_colours(region):
            return np.inf
        parts = (self._colours[part.ravel()] for part in (region, ~region))
        colours = sum(float(self._least(part)) for part in parts)
        beside, above = self._edges
        outline = beside[region[:, 1:] != region[:, :-1]].sum()
        outline += above[region[1:] != region[:-1]].sum()
        return colours + EDGE_COST * float(outline)

    def _least(self, colours: Array) -> float:
        return float(ColourModel.fitted(colours, 3).costs(colours).min(axis=0).sum())


def _have_colours(region: _Mask) -> bool:
    """Return whether a region and its background have pixels for a colour each, however dealt."""
    return bool(min(region.sum(), (~region).sum()) >= LEAST_PIXELS * COLOURS)


def middle_of(shape: tuple[int, ...]) -> _Mask:
    """Return an ellipse in the middle of a picture (H, W)."""
    y, x = (np.linspace(-0.5, 0.5, side) for side in shape[:2])
    return (y[:, None] ** 2 + x**2) < MIDDLE_SHARE**2
