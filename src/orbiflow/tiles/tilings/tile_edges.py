"""The edges of a tiling and the isometries that identify them, from polygons and group alone.

The skeleton of a tiling is the edges of a set of tiles, shared edges only once.
"""

# pyright: reportUnknownMemberType=false
# shapely's stubs leave the keyword arguments of its functions of arrays without types.

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, NamedTuple, TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from orbiflow.arrays import Array, Integers
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import Isometry, identity
from orbiflow.tiles.tilings.prototile import Prototile
from orbiflow.tiles.tilings.surroundings import (
    SegmentMatch,
    Surroundings,
    match_segments,
    surroundings,
)
from orbiflow.tiles.tilings.tile_copies import Copies, CopiesAcross, Placed
from orbiflow.tiles.tilings.tiling import Tiles, Tiling, as_tiling

EdgeKind: TypeAlias = Literal["translation", "rotation", "glide", "mirror"]


class EdgeIdentification(NamedTuple):
    """`isometry` takes edge `first` onto edge `second`, and its tile to the other side of it.

    So across its edge `second` a tile T meets the copy isometry(T'), along that copy's `first`. An
    edge may be its own partner: turned about its middle, or on a mirror that leaves it in place.
    """

    first: int
    second: int
    isometry: Isometry

    @property
    def folded(self) -> bool:
        """Whether the edge is its own partner."""
        return self.first == self.second

    @property
    def reversed(self) -> bool:
        """Whether the start of `first` goes to the end of `second`.

        All tiles have the same orientation, so this holds unless the isometry reverses orientation.
        """
        return self.isometry.determinant > 0

    @property
    def kind(self) -> EdgeKind:
        """The kind of the isometry."""
        linear, shift = self.isometry.linear, self.isometry.translation
        if self.isometry.determinant > 0:
            return "translation" if np.abs(linear - np.eye(2)).max() < 1e-6 else "rotation"
        twice = linear @ shift + shift  # the translation that a transflection applied twice is
        still = np.abs(twice).max() <= 1e-6 * np.abs(shift).max() + 1e-12
        return "mirror" if self.folded or still else "glide"

    @property
    def brief(self) -> str:
        """A short form: = translation, ~ glide, > rotation, | mirror, o half-turn about its middle.

        >>> from orbiflow.symmetry import rotation, translation
        >>> across = EdgeIdentification(0, 3, translation([1.0, 0.0]))
        >>> across.brief, EdgeIdentification(2, 2, rotation([1.0, 0.0], 2)).brief
        ('0=3', '2o')
        """
        kind = self.kind
        if self.folded and kind in ("rotation", "mirror"):
            return f"{self.first}{'o' if kind == 'rotation' else '|'}"
        sign = {"translation": "=", "glide": "~", "rotation": ">", "mirror": "|"}[kind]
        return f"{self.first}{sign}{self.second}"


# the largest distance of equal vertices of two copies, in square roots of the area
VERTEX_TOLERANCE = 1e-7


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of the prototiles, each shared with one neighbour.

    Edges are numbered through all prototiles in order, in the direction of their polygon.

    - `tiling`: The tiling.
    - `owners`: The prototile of each edge.
    - `starts`: The index in that prototile's polygon of the vertex where each edge begins, increasing.
    - `across`: The group element of the tile across each edge, with its prototile.
    - `partners`: The edge of that tile that each edge is.
    - `turned`: For each prototile, where each element of its stabiliser takes its edges, (|S|, E);
      other edges stay.
    """

    tiling: Tiling
    owners: tuple[int, ...]
    starts: tuple[int, ...]
    across: tuple[Placed, ...]
    partners: tuple[int, ...]
    turned: tuple[Integers, ...]

    def __len__(self) -> int:
        return len(self.owners)

    @cached_property
    def following(self) -> tuple[int, ...]:
        """The next edge around the same prototile, for each edge."""
        first = [self.owners.index(k) for k in range(len(self.tiling.prototiles))]
        last = [*first[1:], len(self)]
        return tuple(e + 1 if e + 1 < last[k] else first[k] for e, k in enumerate(self.owners))

    def points(self, edge: int) -> Array:
        """Return (M, 2) vertices of an edge, both ends included."""
        polygon = self.tiling.prototiles[self.owners[edge]].polygon
        first, last = self.starts[edge], self.starts[self.following[edge]]
        length = (last - first - 1) % len(polygon) + 2
        return polygon[(first + np.arange(length)) % len(polygon)]

    @property
    def identifications(self) -> tuple[EdgeIdentification, ...]:
        """Each edge with its partner; mutual partners once, the smaller number first."""
        return tuple(
            EdgeIdentification(partner, edge, self.across[edge])
            for edge, partner in enumerate(self.partners)
            if partner <= edge or self.partners[partner] != edge
        )


def edges(tile: Tiles) -> Edges:
    """Return the edges of a tile or tiling: the longest runs of boundary along one neighbour.

    Args:
        tile: A tile or tiling whose images match vertex by vertex, as for every tile that orbiflow
            finds; `edge_to_edge` adds the vertices that others lack.

    Raises `OrbiflowError` if the images do not match vertex by vertex.

    >>> from orbiflow.tiles import Tile, isohedral_class
    >>> ih4 = isohedral_class("IH4")
    >>> [found.brief for found in edges(Tile(ih4.template(), ih4.group())).identifications]
    ['0o', '2o', '3o', '1=4', '5o']
    """
    tiling = as_tiling(tile)
    numbers = range(len(tiling.prototiles))
    around = [surroundings(tiling, k, VERTEX_TOLERANCE) for k in numbers]
    matches = [match_segments(a, VERTEX_TOLERANCE) for a in around]
    _require_match(tiling, matches)
    begins = [_begins(tiling, a, match) for a, match in zip(around, matches, strict=True)]
    first = np.cumsum([0] + [len(b) for b in begins])
    runs: list[tuple[int, int, Placed, int]] = []
    for k in numbers:
        match, near = matches[k], around[k].copies
        for segment in begins[k]:
            beyond = near.isometry(int(match.tile[segment]))
            partner = _edge_of(begins[beyond.prototile], int(match.partner[segment]))
            start = int(tiling.prototiles[k].kept[segment])
            runs.append((k, start, beyond, int(first[beyond.prototile]) + partner))
    owners, starts, across, partners = zip(*runs, strict=True)
    turned = tuple(_turned(tiling, k, begins[k], first) for k in numbers)
    # make partners mutual where possible, with isometries that are inverses of each other
    return _mutual(Edges(tiling, owners, starts, across, partners, turned))


def _require_match(tiling: Tiling, matches: Sequence[SegmentMatch]) -> None:
    missing = sum(int((match.distance > VERTEX_TOLERANCE).sum()) for match in matches)
    if missing or any(order is None for s in tiling.stabilisers for order in s.orders):
        count = sum(len(match.distance) for match in matches)
        what = f"{missing} of the tile's {count} sides are not sides of a neighbour"
        if not missing:
            what = "the tile's vertices are not as symmetric as its outline"
        raise OrbiflowError(
            f"{what}, so its edges are unknown; certify(tile) reports how its edges match, and "
            "edge_to_edge(tile) adds the missing vertices"
        )


def _begins(tiling: Tiling, around: Surroundings, match: SegmentMatch) -> Integers:
    """Return the segments of a prototile with which an edge begins."""
    sizes = np.array([len(p.ring) for p in tiling.prototiles])
    step = np.where(around.mirrored[match.tile], 1, -1)
    size = sizes[around.copies.prototiles[match.tile]]
    before = (np.roll(match.partner, 1) + step) % size
    continues = (match.tile == np.roll(match.tile, 1)) & (match.partner == before)
    starts = np.flatnonzero(~continues)
    if len(starts) < 2:
        raise OrbiflowError("the tile has fewer than two edges: it cannot tile the plane")
    return starts


def _edge_of(begins: Integers, segment: int) -> int:
    """Return the edge to which a segment belongs, by the segments with which edges begin."""
    return int(np.searchsorted(begins, segment, side="right") - 1) % len(begins)


def _turned(tiling: Tiling, k: int, begins: Integers, first: Integers) -> Integers:
    stabiliser = tiling.stabilisers[k]
    turned = np.tile(np.arange(int(first[-1])), (stabiliser.order, 1))
    for row, element, order in zip(turned, stabiliser.elements, stabiliser.orders, strict=True):
        assert order is not None
        # a segment read backwards begins where its end is taken
        image = order if element.determinant > 0 else np.roll(order, -1)
        for number, segment in enumerate(begins):
            row[first[k] + number] = first[k] + _edge_of(begins, int(image[segment]))
    return turned


def _mutual(net: Edges) -> Edges:
    """Choose partners where a stabiliser leaves a choice: an edge itself, or each other."""
    across, partners = list(net.across), list(net.partners)
    done: NDArray[np.bool_] = np.zeros(len(net), dtype=bool)
    for edge in range(len(net)):
        if done[edge]:
            continue
        there = across[edge].prototile
        images = net.turned[there][:, partners[edge]]
        signs = [s.determinant for s in net.tiling.stabilisers[there].elements]
        choice = np.flatnonzero(images == edge)
        # prefer a mirror to a half-turn: it shows that the edge is straight
        order = np.array(signs)[choice] * across[edge].determinant
        choice = choice[np.argsort(order, kind="stable")]
        if not len(choice):
            choice = np.flatnonzero(~done[images])
        done[edge] = True
        if not len(choice):
            continue  # it has more images in its own tile than its partner has
        by = net.tiling.stabilisers[there].elements[int(choice[0])].inverse()
        element, partner = across[edge] @ by, int(images[choice[0]])
        across[edge] = Placed(element.linear, element.translation, there)
        partners[edge] = partner
        if partner != edge:
            back = element.inverse()
            across[partner] = Placed(back.linear, back.translation, net.owners[edge])
            partners[partner] = edge
            done[partner] = True
    return Edges(net.tiling, net.owners, net.starts, tuple(across), tuple(partners), net.turned)


class EdgeImage(NamedTuple):
    """An edge as the image of another under an isometry; `reversed` if its start is the other's end."""

    edge: int
    isometry: Isometry
    reversed: bool


class EdgeClass(NamedTuple):
    """An edge and all edges that are its images.

    It folds under the isometries, other than the identity, under which it is its own image: at most a
    half-turn about its middle, the mirror along it (not reversed: then it is straight), and the
    mirror across it.
    """

    edge: int  # the first edge of the class
    folds: tuple[EdgeImage, ...]
    images: tuple[EdgeImage, ...]  # the other edges of the class

    @property
    def edges(self) -> list[int]:
        """The numbers of its edges."""
        return [self.edge, *(image.edge for image in self.images)]

    @property
    def turn(self) -> EdgeImage | None:
        """How the edge is its own image backwards, if it is: by a half-turn rather than a mirror."""
        back = (fold for fold in self.folds if fold.reversed)
        return max(back, key=lambda fold: fold.isometry.determinant, default=None)

    @property
    def straight(self) -> bool:
        """Whether the edge lies on a mirror."""
        return any(not fold.reversed for fold in self.folds)


def mixing(tile: Tiles) -> float:
    """Return the share of all boundaries, by length, that copies of different prototiles share.

    Raises `OrbiflowError` as `edge_to_edge`.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> from orbiflow.tiles import dirichlet_tiling
    >>> round(mixing(dirichlet_tiling(wallpaper_group("p4m"), [(0, 0), (0.5, 0.5)])), 9)
    1.0
    """
    net = edges(edge_to_edge(tile))
    lengths = np.array([np.hypot(*np.diff(net.points(k), axis=0).T).sum() for k in range(len(net))])
    differ = [there.prototile != here for there, here in zip(net.across, net.owners, strict=True)]
    return float(lengths[differ].sum() / lengths.sum())


def edge_classes(tile_edges: Edges) -> tuple[EdgeClass, ...]:
    """Return the classes of a tiling's edges; one edge of each class determines all others.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> from orbiflow.tiles import Tiling, edges
    >>> cell = Tiling(wallpaper_group("p4m"), [[[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]])
    >>> [(len(found.images), found.straight) for found in edge_classes(edges(cell))]
    [(3, True)]
    """
    links = _links(tile_edges)
    images: dict[int, EdgeImage] = {}
    classes: list[EdgeClass] = []
    for edge in range(len(tile_edges)):
        if edge in images:
            continue
        images[edge] = EdgeImage(edge, identity(2), reversed=False)
        folds: dict[tuple[int, bool], EdgeImage] = {}
        members: list[EdgeImage] = []
        waiting = deque([edge])
        while waiting:
            here = waiting.popleft()
            for link in links[here]:
                image = EdgeImage(
                    link.edge,
                    link.isometry @ images[here].isometry,
                    images[here].reversed != link.reversed,
                )
                reached = images.get(link.edge)
                if reached is None:
                    images[link.edge] = image
                    members.append(image)
                    waiting.append(link.edge)
                    continue
                loop = reached.isometry.inverse() @ image.isometry
                fold = EdgeImage(edge, loop, reached.reversed != image.reversed)
                folds.setdefault((loop.determinant, fold.reversed), fold)
        folds.pop((1, False), None)  # the identity
        if len(folds) == 2:  # the third follows from both
            first, other = folds.values()
            product = first.isometry @ other.isometry
            third = EdgeImage(edge, product, first.reversed != other.reversed)
            folds[product.determinant, third.reversed] = third
        classes.append(EdgeClass(edge, tuple(folds.values()), tuple(members)))
    return tuple(classes)


def _links(net: Edges) -> list[list[EdgeImage]]:
    """Return, for each edge, its images next to it: beyond it, and in its own tile."""
    links: list[list[EdgeImage]] = [[] for _ in range(len(net))]
    for edge, (partner, element) in enumerate(zip(net.partners, net.across, strict=True)):
        plain = Isometry(element.linear, element.translation)
        turned_over = plain.determinant > 0
        links[partner].append(EdgeImage(edge, plain, turned_over))
        links[edge].append(EdgeImage(partner, plain.inverse(), turned_over))
    for k, stabiliser in enumerate(net.tiling.stabilisers):
        for element, turned in zip(stabiliser.elements[1:], net.turned[k][1:], strict=True):
            for edge in np.flatnonzero(np.array(net.owners) == k).tolist():
                links[edge].append(EdgeImage(int(turned[edge]), element, element.determinant < 0))
    return links


def edge_to_edge(tile: Tiles) -> Tiling:
    """Return the same tiling, with a vertex wherever a neighbour, or the tile's own image, has one.

    Then neighbours have the same vertices on their common boundary. A tiling that is edge to edge
    keeps its vertices.

    Raises `OrbiflowError` if polygon and group are of very different size.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> bricks = Tiling(wallpaper_group("p1", [[2, 1], [0, 1]]), [[[0, 0], [2, 0], [2, 1], [0, 1]]])
    >>> len(edge_to_edge(bricks).prototiles[0].polygon)
    6
    """
    tiling = as_tiling(tile)
    return Tiling(tiling.group, [_with_vertices(tiling, k) for k in range(len(tiling.prototiles))])


def _with_vertices(tiling: Tiling, k: int) -> Prototile:
    prototile, around = tiling.prototiles[k], surroundings(tiling, k, VERTEX_TOLERANCE)
    ring = prototile.ring
    nearby = around.points * np.sqrt(tiling.tile_area) + prototile.center
    points = np.concatenate([nearby, *(s(ring) for s in tiling.stabilisers[k].elements[1:])])
    reach = VERTEX_TOLERANCE * float(np.sqrt(tiling.tile_area))
    line = shapely.LinearRing(ring)
    points = points[shapely.dwithin(line, shapely.points(points), reach)]
    near = np.linalg.norm(points[:, None] - ring, axis=2).min(axis=1, initial=np.inf)
    points = points[near > 2 * reach]
    if not len(points):
        return prototile
    along: Array = np.asarray(shapely.line_locate_point(line, shapely.points(points)))
    order = np.argsort(along)
    fresh = np.diff(along[order], prepend=-np.inf) > 2 * reach
    points, along = points[order][fresh], along[order][fresh]
    steps = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    at = np.searchsorted(np.cumsum(steps) - steps, along, side="right")
    corners = np.searchsorted(prototile.kept, prototile.corners, side="left")
    moved = corners + np.searchsorted(at, corners, side="right")
    return Prototile(np.insert(ring, at, points, axis=0), tuple(int(c) for c in moved))


@dataclass(frozen=True, eq=False)
class Skeleton:
    """S edges of copies of prototiles.

    Edges that meet within the set share the number of that vertex; one where copies only touch may
    have several.
    """

    copy: (
        Integers  # with `edge`: edge `edge` of copy `copy`, (S,), in the direction of its boundary
    )
    edge: Integers
    other: Integers  # the copy (S,) across it, -1 if it is not in the set
    ends: Integers  # the numbers (S, 2) of its first and last vertex

    def __len__(self) -> int:
        return len(self.copy)


def skeleton(tile_edges: Edges, copies: Copies) -> Skeleton:
    """Return each edge of each copy once.

    Edge k of the copy g is edge partner(k) of g @ across(k).

    The search uses only aspects and cells, no positions, so that no edge is drawn twice or lost,
    however close edges come to each other.

    Args:
        tile_edges: The edges of the copies' tiling.
        copies: Any of its tiles.

    >>> from orbiflow.tiles import CLASSES, Tile, copies_inside, edges
    >>> tile = Tile(CLASSES["IH1"].template(), CLASSES["IH1"].group())
    >>> both = copies_inside(tile, (-1.01, -1, 2.6, 2))
    >>> len(both), len(skeleton(edges(tile), both))
    (2, 11)
    """
    beyond = copies.neighbours(tile_edges.across, tile_edges.owners)
    mine = copies.prototiles[:, None] == np.array(tile_edges.owners)
    numbers = np.arange(len(copies))[:, None]
    copy, edge = np.nonzero(mine & ((beyond.copy < 0) | (beyond.copy > numbers)))
    vertices = _vertices(tile_edges, beyond)
    ends = np.stack(
        [vertices[copy, edge], vertices[copy, np.array(tile_edges.following)[edge]]], axis=1
    )
    return Skeleton(copy, edge, beyond.copy[copy, edge], ends)


def _vertices(net: Edges, beyond: CopiesAcross) -> Integers:
    """Return (M, E) number of the vertex in which edge k of each copy starts."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, sides = beyond.copy.shape
    following = np.array(net.following)
    links: list[Integers] = []
    for k, (partner, element) in enumerate(zip(net.partners, net.across, strict=True)):
        copy = np.flatnonzero(beyond.copy[:, k] >= 0)
        there, turn = beyond.copy[copy, k], beyond.turn[copy, k]
        # the copy beyond is its own image by an element of its stabiliser: so are its edges
        mate = net.turned[element.prototile][turn, partner]
        symmetries = net.tiling.stabilisers[element.prototile].elements
        signs = np.array([s.determinant for s in symmetries])[turn] * element.determinant
        begin: Integers = there * sides + mate
        end: Integers = there * sides + following[mate]
        start = np.where(signs > 0, end, begin)
        stop = np.where(signs > 0, begin, end)
        links.append(np.stack([copy * sides + k, start]))
        links.append(np.stack([copy * sides + following[k], stop]))
    first, second = np.concatenate(links, axis=1)
    size = count * sides
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(size, size))
    _, labels = connected_components(graph, directed=False)
    return np.asarray(labels, dtype=np.int64).reshape(count, sides)
