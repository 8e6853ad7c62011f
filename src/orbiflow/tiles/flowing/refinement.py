"""Tiles by a loss of one's own: descent in the linear space of the polygons that tile as one does.

What descends are parameters of `TileVariations`, so that nothing is left to match: only folds are
refused.
"""

from collections.abc import Callable

import numpy as np
import scipy.linalg
import shapely
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import NEVER, Cancel, one_blas_thread, one_thread
from orbiflow.settings import as_number, as_whole, described, is_tensor
from orbiflow.tiles.geometry import signed_area
from orbiflow.tiles.likeness import Likeness, narrowest_neck
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.search import MAX_POINTS, TileVariations, divided_tile
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tilings import certify

Loss = Callable[[Tensor], Tensor]
"""A differentiable function of a polygon (N, 2), float64, that gives one number."""

MAX_HALVINGS = 25  # of a step, until it lowers the loss and the outline does not touch itself
MIN_GAIN = 1e-5  # of eight steps, as a share of what all gained, for the descent to go on
# in square roots of the area
SMOOTHING_WAVELENGTH = 0.6  # wavelength below which moves are damped
MAX_MOVE = 0.1  # of a vertex in one step
MIN_CLEARANCE = 2e-3  # least width of gaps and necks
MIN_SIDE = 1e-6  # least distance of vertices that follow each other


def refine(
    tile: TileSource,
    loss: Loss,
    *,
    pull: float = 0.0,
    steps: int = 200,
    points: int = 240,
    cancel: Cancel = NEVER,
) -> EscherTile:
    """Change a tile so that a loss of your own becomes small, and return the certified tile.

    There is no flow and no prototile: what changes is the polygon with its group, namely free vertices,
    whose images the others are, and the lattice as far as the point group lets it. The area stays. A
    step that would make the outline cross itself, or leave a gap or neck of less than 0.2 % of the
    tile's size, is halved until it does not, and short waves are damped (Sobolev descent): the outline
    cannot fold. The descent ends in a minimum, after `steps`, or where it cannot go on without a fold;
    the notes of the tile say so.

    Args:
        tile: A certified tile to start from: an `EscherTile`, a `Tile` or the folder of a result.
        loss: A differentiable function of the polygon (N, 2), a float64 tensor in the coordinates of
            the tile. Vertices keep their order, so it may compare them one by one.
        pull: The weight of likeness: of a term added to the loss, the mean squared distance of the
            outline from where it was, in units of the tile's area.
        steps: The largest number of steps.
        points: About how many vertices there are, at most 2,000: longer sides are divided.
        cancel: A token that stops the descent.

    Raises:
        OrbiflowError: for settings out of range, a tile with more than 2,000 vertices, or a loss that
            does not give one finite, differentiable number for the tile.
        CertificationError: if the tile is not certified to begin with.

    >>> from orbiflow.tiles import Tile, isohedral_class
    >>> ih4, wide = isohedral_class("IH4"), np.diag([1.2, 1 / 1.2])
    >>> skewed = Tile(ih4.template() @ wide, ih4.group().conjugate(wide))
    >>> regular = refine(skewed, lambda p: (p - p.roll(1, 0)).norm(dim=1).sum(), points=24)
    >>> regular.certificate.valid, float(np.linalg.norm(regular.tile.polygon, axis=1).max().round(3))
    (True, 1.0)
    """
    as_number(pull, "pull", 0)
    as_whole(steps, "steps", 1)
    as_whole(points, "points", 3, MAX_POINTS)
    if not callable(loss):
        how = "the loss must be a function of the polygon (N, 2), a tensor"
        raise OrbiflowError(f"{how}, got {described(loss)}")
    start = as_tile(tile)
    start.require_certified(otherwise="so no loss can be lowered from it: give a tile that is")
    with one_thread(), one_blas_thread():
        space = TileVariations(divided_tile(start.tile, points))
        descent = _Descent(space, loss, pull)
        for _ in range(steps):
            cancel.check()
            if not descent.step():
                break
        refined = next(t for t in map(space.tile, reversed(descent.path)) if certify(t).valid)
    return EscherTile(
        refined,
        name=start.name,
        y_down=start.y_down,
        silhouette=start.silhouette,
        no_map="its outline was changed by a loss of one's own",
        notes=(descent.note(),),
        likeness=Likeness(thinnest=narrowest_neck(refined.polygon)),
    )


class _Descent:
    """Gradient descent in the space of a tile, with backtracking.

    Moves are measured by their values and their slopes along the outline, and the length of a step is
    that of Barzilai and Borwein (Two-Point Step Size Gradient Methods, 1988).
    """

    def __init__(self, space: TileVariations, loss: Loss, pull: float) -> None:
        self.space, self.loss, self.pull = space, loss, pull
        ring = space.first.polygon
        self.size = float(np.sqrt(abs(space.first.signed_area)))
        sides = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
        self.shares = (sides + np.roll(sides, 1)) / (2 * sides.sum())
        moves = space.matrix.reshape(len(ring), 2, -1)
        width = SMOOTHING_WAVELENGTH * self.size / np.sqrt(sides * sides.sum())
        slopes = (np.roll(moves, -1, axis=0) - moves) * width[:, None, None]
        values = moves * np.sqrt(self.shares)[:, None, None]
        flat = np.concatenate([values, slopes]).reshape(-1, moves.shape[2])
        metric = flat.T @ flat
        # what moves no vertex, such as a free one that a centre holds
        metric[np.diag_indices_from(metric)] += 1e-10 * np.trace(metric) / len(metric)
        self.metric = scipy.linalg.cho_factor(metric)
        self.clearance = min(MIN_CLEARANCE, 0.5 * _clearance(shapely.Polygon(ring)))
        value, self.gradient = self.evaluated(space.start)
        if not np.isfinite([value, *self.gradient]).all():
            raise OrbiflowError("the loss of the tile, or its gradient, is not a finite number")
        self.path, self.values = [space.start], [value]
        self.length, self.blocked = np.inf, False

    def evaluated(self, parameters: Array) -> tuple[float, Array]:
        """Return the loss of the tile for parameters (P,), and its gradient."""
        first, variables = self.space.first, torch.tensor(parameters, requires_grad=True)
        polygon = (torch.tensor(self.space.matrix) @ variables).reshape(-1, 2)
        center, scale = torch.tensor(first.center), self.size / signed_area(polygon).abs().sqrt()
        polygon = center + scale * (polygon - center)
        value = self.loss(polygon)
        if not is_tensor(value) or value.numel() != 1 or not value.requires_grad:
            how = "one number that depends on the polygon by torch's operations"
            raise OrbiflowError(f"the loss must give {how}, got {described(value)}")
        away = (polygon - torch.tensor(first.polygon)).square().sum(dim=1) / self.size**2
        total = value.reshape(()).double() + self.pull * (away @ torch.tensor(self.shares))
        (gradient,) = torch.autograd.grad(total, variables)
        return float(total.detach()), gradient.numpy()

    def step(self) -> bool:
        """Take one step, halved until it is allowed; return whether it was worth it."""
        here, last, before = self.path[-1], self.values[-1], self.gradient
        move: Array = -scipy.linalg.cho_solve(self.metric, before)
        longest = float(np.linalg.norm(self.space.polygon(move), axis=1).max())
        slope = float(before @ move)
        if not (slope < 0 and longest > 0):
            return False
        touched = False
        length = min(self.length, MAX_MOVE * self.size / longest)
        for _ in range(MAX_HALVINGS):
            there = here + length * move
            outline = shapely.Polygon(self.space.polygon(there))
            if not outline.is_valid or _clearance(outline) < self.clearance:
                touched = True
            else:
                value, gradient = self.evaluated(there)
                if value <= last + 1e-4 * length * slope and np.isfinite(gradient).all():
                    break
                touched = False  # a shorter step was no better: it is the loss that ends it
            length /= 2
        else:
            self.blocked = touched
            return False
        self.blocked = touched
        bend = float(move @ (gradient - before))
        self.length = -length * slope / bend if bend > 0 else np.inf
        self.gradient = gradient
        self.path.append(there)
        self.values.append(value)
        return self.values[-8:][0] - value > MIN_GAIN * (self.values[0] - value)

    def note(self) -> str:
        """Return in words what the descent did."""
        first, last, count = self.values[0], self.values[-1], len(self.path) - 1
        cut = ", the last of them cut short, as the outline would have touched itself"
        done = f"a loss of one's own was lowered from {first:.4g} to {last:.4g} in {count} steps"
        return done + cut * self.blocked


def _clearance(outline: shapely.Polygon) -> float:
    """Return the least distance of parts of an outline from others, in square roots of its area.

    Vertices that crowd together count as one, unless they come so near that rounding matters.
    """
    size = float(np.sqrt(outline.area))
    if outline.minimum_clearance < MIN_SIDE * size:
        return 0.0
    thinned = shapely.remove_repeated_points(outline, 3 * MIN_CLEARANCE * size)
    return float(thinned.minimum_clearance) / size
