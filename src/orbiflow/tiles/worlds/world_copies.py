"""The copies of a tile in another world, and their colours."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.tiles.worlds.unfolding import Unfolding

Booleans = NDArray[np.bool_]

SAME = 1e-3  # of vectors' coordinates: middles of copies are farther apart, wherever they are
FEW_COLOURS = 6  # that a colouring by the group has at most
MOST_CHOICES = 150_000  # of permutations that are tried
LONGEST_WORD = 8  # of rotations by which a neighbour is reached


def copies(unfolding: Unfolding, shown: Callable[[Array], Booleans], most: int) -> Array:
    """Return the motions (M, 3, 3) to the tile's copies, itself first, then from one to the next.

    Those that are not `shown`, of motions (E, 3, 3), end the way; there are `most` at most.
    """
    near, middle = unfolding.neighbours, unfolding.middle
    copied, seen, ahead = [np.eye(3)], {_key(middle)}, deque([np.eye(3)])
    while ahead and len(copied) < most:
        motions = ahead.popleft() @ near
        keys = [_key(place) for place in motions @ middle]
        fresh = [k for k, key in enumerate(keys) if key not in seen]
        seen.update(keys[k] for k in fresh)
        if fresh:
            kept = motions[fresh][shown(motions[fresh])]
            copied += [*kept]
            ahead += [*kept]
    return np.stack(copied)[:most]


def _key(vector: Array) -> tuple[int, ...]:
    """Return what tells a middle from others: they are apart by more than its rounding."""
    return tuple(np.rint(vector / SAME).astype(np.int64).tolist())


def colours(unfolding: Unfolding, motions: Array) -> tuple[Integers, int]:
    """Return the colour (M,) of each copy, and their number: neighbours differ.

    The world's group permutes the colours if a small number allows that; else each copy has the first
    colour that its neighbours leave.
    """
    grouped = _by_group(unfolding, motions)
    if grouped is not None:
        return grouped
    middles = motions @ unfolding.middle
    index = {_key(place): k for k, place in enumerate(middles)}
    numbers = np.full(len(motions), -1)
    for k, motion in enumerate(motions):
        beside = {
            index.get(_key(place), -1) for place in motion @ unfolding.neighbours @ unfolding.middle
        }
        taken = {int(numbers[j]) for j in beside if j >= 0}
        numbers[k] = next(c for c in range(len(taken) + 1) if c not in taken)
    return numbers, int(numbers.max()) + 1


def _by_group(unfolding: Unfolding, motions: Array) -> tuple[Integers, int] | None:
    moves = colour_moves(unfolding)
    return None if moves is None else _spread(unfolding, motions, moves)


def colour_moves(unfolding: Unfolding, most: int = FEW_COLOURS) -> list[Integers] | None:
    """Return for each neighbour the permutation of the colours that its motion makes.

    A copy's neighbour k has the colours of the copy in the order `moves[k]`; the first is its own.
    None if no number of colours up to `most` does.
    """
    if unfolding.generators is None:
        return None
    *turns, _ = unfolding.generators[0]
    *powers, last = unfolding.generators[1]
    words = _words(turns, [*unfolding.neighbours], unfolding.middle)
    if words is None:
        return None
    for count in range(2, most + 1):
        every = [np.array(order) for order in permutations(range(count))]
        choices = [[order for order in every if _is_one(order, power)] for power in powers]
        if np.prod([len(options) for options in choices]) > MOST_CHOICES:
            return None
        for choice in product(*choices):
            whole = choice[0]
            for order in choice[1:]:
                whole = whole[order]
            if not _is_one(whole, last):
                continue
            moves = [_moved(word, (*choice, *map(np.argsort, choice))) for word in words]
            if all(move[0] != 0 for move in moves):
                return moves
    return None


def _is_one(permutation: Integers, power: int) -> bool:
    image = np.arange(len(permutation))
    for _ in range(power):
        image = permutation[image]
    return bool((image == np.arange(len(permutation))).all())


def _moved(word: tuple[int, ...], letters: tuple[Integers, ...]) -> Integers:
    """Return the permutation of a word, whose last letter acts first."""
    image = np.arange(len(letters[0]))
    for letter in reversed(word):
        image = letters[letter][image]
    return image


def _words(turns: list[Array], goals: list[Array], middle: Array) -> list[tuple[int, ...]] | None:
    """Return goals as words of k rotations, 0 to k - 1, and their inverses, k to 2 k - 1."""
    letters = [*turns, *(np.linalg.inv(turn) for turn in turns)]
    left, words = (
        {_key(goal @ middle): k for k, goal in enumerate(goals)},
        dict[int, tuple[int, ...]](),
    )
    seen, level = {_key(middle)}, [((), np.eye(3))]
    for _ in range(LONGEST_WORD):
        fresh = list[tuple[tuple[int, ...], Array]]()
        for word, motion in level:
            for number, letter in enumerate(letters):
                moved = motion @ letter
                if (key := _key(moved @ middle)) in seen:
                    continue
                seen.add(key)
                longer = (*word, number)
                fresh.append((longer, moved))
                if key in left:
                    words[left[key]] = longer
        if len(words) == len(goals):
            return [words[k] for k in range(len(goals))]
        level = fresh
    return None


def _spread(unfolding: Unfolding, motions: Array, moves: list[Integers]) -> tuple[Integers, int]:
    """Return the colour of each copy: that to which its motion takes the first one."""
    middle, near = unfolding.middle, unfolding.neighbours
    index = {_key(place): k for k, place in enumerate(motions @ middle)}
    of = {index[_key(middle)]: np.arange(len(moves[0]))}
    ahead = deque(of)
    while ahead:
        k = ahead.popleft()
        for place, move in zip(motions[k] @ near @ middle, moves, strict=True):
            j = index.get(_key(place))
            if j is not None and j not in of:
                of[j] = of[k][move]
                ahead.append(j)
    numbers = np.array([int(of[k][0]) if k in of else 0 for k in range(len(motions))])
    return numbers, len(moves[0])
