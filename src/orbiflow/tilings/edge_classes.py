"""Edges that are images of each other, across or within their tiles: one of each says them all."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

import numpy as np

from orbiflow.symmetry import Isometry, identity
from orbiflow.tilings.edges import Edges


class EdgeImage(NamedTuple):
    """An edge as an image of another: by which isometry, and whether its start is the other's end."""

    edge: int
    isometry: Isometry
    reversed: bool


class EdgeClass(NamedTuple):
    """An edge, and all that follows from it.

    - `edge`: the first of the class.
    - `folds`: how it is its own image, other than by the identity: at most a half-turn about its
      middle, the mirror along it (not reversed: then it is straight), and the mirror across it.
    - `images`: the other edges of the class.
    """

    edge: int
    folds: tuple[EdgeImage, ...]
    images: tuple[EdgeImage, ...]

    @property
    def straight(self) -> bool:
        """Whether the edge lies on a mirror."""
        return any(not fold.reversed for fold in self.folds)


def edge_classes(own: Edges) -> tuple[EdgeClass, ...]:
    """The classes of a tiling's edges: whoever draws or fits one edge of each draws them all.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> from orbiflow.tilings import Tiling, edges
    >>> cell = Tiling(wallpaper_group("p4m"), [[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]])
    >>> [(len(found.images), found.straight) for found in edge_classes(edges(cell))]
    [(3, True)]
    """
    links = _links(own)
    found: dict[int, EdgeImage] = {}
    classes: list[EdgeClass] = []
    for edge in range(len(own)):
        if edge in found:
            continue
        found[edge] = EdgeImage(edge, identity(2), reversed=False)
        folds: dict[tuple[int, bool], EdgeImage] = {}
        members: list[EdgeImage] = []
        waiting = deque([edge])
        while waiting:
            here = waiting.popleft()
            for link in links[here]:
                image = EdgeImage(
                    link.edge,
                    link.isometry @ found[here].isometry,
                    found[here].reversed != link.reversed,
                )
                known = found.get(link.edge)
                if known is None:
                    found[link.edge] = image
                    members.append(image)
                    waiting.append(link.edge)
                    continue
                loop = known.isometry.inverse() @ image.isometry
                fold = EdgeImage(edge, loop, known.reversed != image.reversed)
                folds.setdefault((loop.determinant, fold.reversed), fold)
        folds.pop((1, False), None)  # the identity
        classes.append(EdgeClass(edge, tuple(_closed(edge, folds)), tuple(members)))
    return tuple(classes)


def _links(own: Edges) -> list[list[EdgeImage]]:
    """For each edge its images next to it: beyond it, and in its own tile."""
    links: list[list[EdgeImage]] = [[] for _ in range(len(own))]
    for edge, (partner, element) in enumerate(zip(own.partners, own.across, strict=True)):
        plain = Isometry(element.linear, element.translation)
        turned_over = plain.determinant > 0
        links[partner].append(EdgeImage(edge, plain, turned_over))
        links[edge].append(EdgeImage(partner, plain.inverse(), turned_over))
    for k, stabiliser in enumerate(own.tiling.stabilisers):
        for element, turned in zip(stabiliser.elements[1:], own.turned[k][1:], strict=True):
            for edge in np.flatnonzero(np.array(own.owners) == k).tolist():
                links[edge].append(EdgeImage(int(turned[edge]), element, element.determinant < 0))
    return links


def _closed(edge: int, folds: dict[tuple[int, bool], EdgeImage]) -> list[EdgeImage]:
    """With the third of two."""
    if len(folds) == 2:
        one, other = folds.values()
        third = EdgeImage(edge, one.isometry @ other.isometry, one.reversed != other.reversed)
        folds[third.isometry.determinant, third.reversed] = third
    return list(folds.values())
