"""Closed curves along which a grid of values crosses a level, by marching squares.

Lorensen and Cline, Marching cubes, 1987, in two dimensions.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from itertools import chain

import numpy as np

from orbiflow.arrays import Array

TOP, RIGHT, BOTTOM, LEFT = range(4)

MIN_NODE_DISTANCE = 1e-3
"""Least distance of a curve from the grid's nodes, in sides of its cells.

Through a node whose value is the level itself, several pieces of curves would go and touch there.
"""

# The sides of a cell that a curve enters and leaves by, with what is above the level to its right, for
# each set of its corners above the level: 1 upper left, 2 upper right, 4 lower right, 8 lower left
_STEPS = {
    1: [(TOP, LEFT)],
    2: [(RIGHT, TOP)],
    3: [(RIGHT, LEFT)],
    4: [(BOTTOM, RIGHT)],
    6: [(BOTTOM, TOP)],
    7: [(BOTTOM, LEFT)],
    8: [(LEFT, BOTTOM)],
    9: [(TOP, BOTTOM)],
    11: [(RIGHT, BOTTOM)],
    12: [(LEFT, RIGHT)],
    13: [(TOP, RIGHT)],
    14: [(LEFT, TOP)],
    # two corners that meet across the cell do not hold together
    5: [(TOP, LEFT), (BOTTOM, RIGHT)],
    10: [(RIGHT, TOP), (LEFT, BOTTOM)],
}


def level_curves(values: Array, level: float) -> list[Array]:
    """Return the closed curves between values (H, W) above a level and the others.

    Values are linear along the sides between neighbours. No curve touches itself or another.

    Args:
        values: The grid; its outermost values are not above the level.
        level: The level.

    Returns:
        Curves (N, 2) of rows and columns, the last point equal to the first; seen with rows going down
        and columns to the right, what is above the level lies to their right.

    >>> level_curves(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 0]]), 0.5)[0].tolist()
    [[1.5, 1.0], [1.0, 0.5], [0.5, 1.0], [1.0, 1.5], [1.5, 1.0]]
    """
    values = np.asarray(values, dtype=np.float64)
    above = values > level
    kind = above[:-1, :-1] + 2 * above[:-1, 1:] + 4 * above[1:, 1:] + 8 * above[1:, :-1]
    width = values.shape[1]
    # sides by the number of their first node, those down from it after all those to its right
    sides = np.array([0, values.size + 1, width, values.size])
    steps, cells = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0, dtype=np.int64)]
    for corners, pairs in _STEPS.items():
        rows, columns = np.nonzero(kind == corners)
        first = rows * width + columns
        steps += [first[:, None] + sides[list(pair)] for pair in pairs]
        cells += [first] * len(pairs)
    order = np.argsort(np.concatenate(cells), kind="stable")
    loops = _loops(np.concatenate(steps)[order].tolist())
    points = _crossings(values, np.fromiter(chain(*loops), dtype=np.int64), level)
    ends = np.cumsum([len(loop) for loop in loops])[:-1]
    return np.split(points, ends) if loops else []


def _loops(steps: Iterable[tuple[int, int]]) -> list[deque[int]]:
    """Return closed loops of steps, each from one side to another, the first side also as the last.

    Chains grow as steps come, and two that meet are joined to the older one.
    """
    begun: dict[int, tuple[int, deque[int]]] = {}
    ended: dict[int, tuple[int, deque[int]]] = {}
    closed: dict[int, deque[int]] = {}
    for age, (start, end) in enumerate(steps):
        before, after = ended.pop(start, None), begun.pop(end, None)
        if before is None and after is None:
            chained = age, deque((start, end))
        elif before is None or after is None:
            chained = before or after
            assert chained is not None
            chained[1].append(end) if before else chained[1].appendleft(start)
        elif before[0] == after[0]:
            before[1].append(end)
            closed[before[0]] = before[1]
            continue
        elif before[0] > after[0]:
            after[1].extendleft(reversed(before[1]))
            chained = after
        else:
            before[1].extend(after[1])
            chained = before
        begun[chained[1][0]] = ended[chained[1][-1]] = chained
    return [closed[age] for age in sorted(closed)]


def _crossings(values: Array, sides: Array, level: float) -> Array:
    """Return where the level is crossed on sides (N,): rows and columns (N, 2)."""
    down, node = np.divmod(sides, values.size)
    row, column = np.divmod(node, values.shape[1])
    start, end = values[row, column], values[row + down, column + 1 - down]
    share = ((level - start) / (end - start)).clip(MIN_NODE_DISTANCE, 1 - MIN_NODE_DISTANCE)
    return np.stack([row + down * share, column + (1 - down) * share], axis=1)
