"""The template and the group of an isohedral type, from its incidence symbol.

An isohedral tiling looks, up to a homeomorphism, like one of the eleven Laves tilings with some of
its symmetries left (Grünbaum and Shephard, Tilings and Patterns, 1987, chapters 4 and 6). A Laves
tile has an inscribed circle and angles of 360 degrees over the valences of its vertices. The symbol
says which symmetries are left. A letter stands for the edges of a tile that its own symmetries take
onto each other; its sign says in which direction, and an edge without a sign has both. After the
letters of all edges, in order, the symbol has for each letter the one that the edge has in the
neighbour's eyes, with "+" if the two directions are opposite.
"""

from __future__ import annotations

import re
from functools import cached_property
from itertools import combinations
from math import pi

import numpy as np

from orbiflow.arrays import Array
from orbiflow.symmetry import CrystallographicGroup, Isometry, identity, rotation_matrix

_AREA = 1.5 * np.sqrt(3.0)  # of the regular hexagon of sides 1: all templates have it
_SIGNS = {"+": 1, "-": -1, "": 0}


def laves_tile(valences: tuple[int, ...]) -> Array:
    """Return the tile (K, 2) whose corners have these valences, counter-clockwise about the origin.

    >>> laves_tile((4, 4, 4, 4)).round(3).tolist()
    [[0.806, 0.806], [-0.806, 0.806], [-0.806, -0.806], [0.806, -0.806]]
    """
    half = pi / np.array(valences)  # half of each angle
    turns = pi - 2 * half  # between the two points of contact beside each corner
    toward = pi / 4 + np.cumsum(turns) - turns / 2 - turns[0] / 2
    corners = np.stack([np.cos(toward), np.sin(toward)], axis=1) / np.sin(half)[:, None]
    return corners * np.sqrt(_AREA / (1 / np.tan(half)).sum())


class IncidenceSymbol:
    """An incidence symbol on the Laves tile with the given valences.

    >>> kite = IncidenceSymbol("3.4.6.4", "a+b+b-a- a-b-")
    >>> kite.group("p6m").order, len(kite.stabiliser)
    (12, 2)
    """

    def __init__(self, valences: str, symbol: str) -> None:
        edges, neighbours = symbol.split()
        self.labels = [(name, _SIGNS[sign]) for name, sign in re.findall(r"([a-z])([+-]?)", edges)]
        letters = dict.fromkeys(name for name, _ in self.labels)
        partners = re.findall(r"([a-z])([+-]?)", neighbours)
        self.adjacent = {
            k: (name, _SIGNS[sign]) for k, (name, sign) in zip(letters, partners, strict=True)
        }
        self._tile = laves_tile(tuple(int(valence) for valence in valences.split(".")))

    @cached_property
    def template(self) -> Array:
        """The Laves tile (K, 2), turned so that mirrors and glide lines have the axes' directions.

        Without any, its first edge is level.
        """
        elements = [*self._stabiliser(self._tile), *self._across(self._tile)]
        # a mirror of the tile's own comes first, and becomes upright
        flips = [np.arctan2(g.linear[1, 0], g.linear[0, 0]) for g in elements if g.determinant < 0]
        edge = np.arctan2(*(self._tile[1] - self._tile[0])[::-1])
        return self._tile @ rotation_matrix(pi / 2 - flips[0] / 2 if flips else pi - edge).T

    @cached_property
    def stabiliser(self) -> tuple[Isometry, ...]:
        """The symmetries of a tile of its own, the identity first."""
        return self._stabiliser(self.template)

    def group(self, name: str) -> CrystallographicGroup:
        """Return the group that the steps to the neighbours and the tile's own symmetries generate."""
        generators = [*self._across(self.template), *self.stabiliser[1:]]
        elements, shifts = [identity(2)], list[Array]()
        for element in elements:  # grows while it is walked
            for generator in generators:
                product = generator @ element
                same = [g for g in elements if np.allclose(g.linear, product.linear, atol=1e-6)]
                elements += [] if same else [product]
                shifts += [(g.inverse() @ product).translation for g in same]
        volume = _AREA * len(elements) / len(self.stabiliser)
        bases = (np.stack(pair, axis=1) for pair in combinations(shifts, 2))
        lattice = next(b for b in bases if abs(abs(np.linalg.det(b)) - volume) < 1e-6)
        return CrystallographicGroup.generate(lattice, generators, name=name)

    def _stabiliser(self, corners: Array) -> tuple[Isometry, ...]:
        """Return the symmetries of the corners that keep the labels."""
        edges, count = self.labels, len(self.labels)
        symmetries: list[Isometry] = []
        for sign in (1, -1):
            turned = [(name, sign * direction) for name, direction in edges]
            for first in range(count):
                order = (first + sign * np.arange(count)) % count
                if [edges[k] for k in order] == turned:
                    image = (first + (sign < 0) + sign * np.arange(2)) % count
                    symmetries.append(_carried(corners[:2], corners[image], sign))
        return tuple(symmetries)

    def _across(self, corners: Array) -> tuple[Isometry, ...]:
        """Return for each edge an element that takes the tile to its other side."""
        steps: list[Isometry] = []
        for k, (name, direction) in enumerate(self.labels):
            partner, relation = self.adjacent[name]
            j = next(j for j, label in enumerate(self.labels) if label[0] == partner)
            sign = relation * direction * self.labels[j][1] or 1
            there = corners[[k, (k + 1) % len(corners)]]
            here = corners[[j, (j + 1) % len(corners)]]
            steps.append(_carried(here, there[::-1] if sign > 0 else there, sign))
        return tuple(steps)


def _carried(here: Array, there: Array, sign: int) -> Isometry:
    """Return the isometry of determinant `sign` that takes two points (2, 2) to two others."""
    start, end = here[1] - here[0], there[1] - there[0]
    flip = np.diag([1.0, sign])
    angle = np.arctan2(end[1], end[0]) - np.arctan2(sign * start[1], start[0])
    linear = rotation_matrix(angle) @ flip
    return Isometry(linear, there.mean(axis=0) - linear @ here.mean(axis=0))
