"""Crystallographic groups of R^d: a lattice and coset representatives modulo it.

Their headers are JSON with the exact bases, in which saved parameters are coordinates.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache, wraps
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arrays import Array
from orbiflow.errors import GroupError, LatticeMismatchError, NotDiscreteError
from orbiflow.symmetry.isometry import (
    TOLERANCE,
    Isometry,
    Points,
    cast_like,
    check_dimension,
    identity,
    translation,
)

MAX_ORDER, MAX_DIM, MAX_NAME = 2048, 64, 200

LONGEST = 1e50
"""Length of a basis vector of a lattice, and its inverse the shortest: volumes stay finite."""


def checked_lattice(lattice: ArrayLike) -> Array:
    """Return a read-only float64 copy of a lattice basis; raise GroupError if it is degenerate."""
    basis = np.array(lattice, dtype=np.float64)
    if basis.ndim != 2 or basis.shape[0] != basis.shape[1] or basis.size == 0:
        raise GroupError(
            f"a lattice is a (d, d) matrix with basis vectors as columns, got shape {basis.shape}"
        )
    longest = np.abs(basis).max(axis=0)
    if not np.isfinite(basis).all() or longest.min() == 0.0:
        raise GroupError("the lattice basis has a zero, NaN or infinite column")
    if longest.max() > LONGEST or longest.min() < 1 / LONGEST:
        raise GroupError(
            f"the lattice's lengths must be between {1 / LONGEST:g} and {LONGEST:g}, got "
            f"{longest.max() if longest.max() > LONGEST else longest.min():g}: choose another unit"
        )
    lengths = np.linalg.norm(basis, axis=0)
    if abs(np.linalg.det(basis / lengths)) < 1e-6:
        raise GroupError("the lattice basis vectors are (nearly) linearly dependent")
    basis.setflags(write=False)
    return basis


@dataclass(frozen=True, eq=False)
class CrystallographicGroup:
    """A discrete group of isometries whose translations contain a full lattice.

    Build one with `generate`; the constructor does not check its arguments. Two groups are equal if
    they are the same set of isometries, within 1e-9 as in `contains`; their bases, coset
    representatives and names may differ.

    Args:
        lattice: The basis vectors as columns, shape (d, d).
        cosets: One representative of each coset of the lattice, the identity first, with
            translations in the cell (fractional coordinates in [0, 1)).
        name: A name for people to read, such as "pgg".

    Reference: design points 1 and 2. The paper's operators generate such a group.
    """

    lattice: Array
    cosets: tuple[Isometry, ...]
    name: str = field(default="")

    @classmethod
    def generate(
        cls,
        lattice: ArrayLike,
        generators: Iterable[Isometry] = (),
        *,
        name: str = "",
        max_order: int = 2048,
    ) -> CrystallographicGroup:
        """Close `generators` modulo the translations of `lattice`.

        Raises:
            LatticeMismatchError: if a generator does not map the lattice to itself.
            NotDiscreteError: if the closure modulo the lattice has over `max_order` elements.
            GroupError: for a degenerate lattice or a generator of another dimension.

        >>> from orbiflow.symmetry import rotation
        >>> CrystallographicGroup.generate(np.eye(2), [rotation((0.0, 0.0), 4)]).order
        4
        """
        basis = checked_lattice(lattice)
        reduced: list[Isometry] = []
        for number, generator in enumerate(generators):
            _check_maps_lattice(basis, generator, number)
            reduced.append(_reduce_translation(basis, generator))
        return cls(basis, _closure(basis, reduced, max_order), name)

    @property
    def dim(self) -> int:
        """Dimension d of the space."""
        return self.lattice.shape[0]

    @property
    def order(self) -> int:
        """Number of cosets of the lattice: |G| in the paper's sums."""
        return len(self.cosets)

    @property
    def cell_volume(self) -> float:
        """|det B|, the volume of a lattice cell."""
        return float(abs(np.linalg.det(self.lattice)))

    @cached_property
    def inverse_lattice(self) -> Array:
        """B^-1: takes points to fractional coordinates."""
        return np.linalg.inv(self.lattice)

    @cached_property
    def linear_parts(self) -> Array:
        """(|G|, d, d) linear parts of the coset representatives."""
        return np.stack([g.linear for g in self.cosets])

    @cached_property
    def integral_parts(self) -> Array:
        """(|G|, d, d) linear parts in the lattice's basis: the integers B^-1 R B."""
        return np.round(self.inverse_lattice @ self.linear_parts @ self.lattice).astype(np.int64)

    @cached_property
    def translations(self) -> Array:
        """(|G|, d) translations of the coset representatives."""
        return np.stack([g.translation for g in self.cosets])

    def __eq__(self, other: object) -> bool:
        """Return whether both groups are the same set of isometries."""
        # each must contain the other's generators
        if not isinstance(other, CrystallographicGroup):
            return NotImplemented
        if other is self:
            return True
        share, its_share = self.cell_volume / self.order, other.cell_volume / other.order
        if self._invariants != other._invariants or not math.isclose(
            share, its_share, rel_tol=1e-6
        ):
            return False
        pairs = (self, other), (other, self)
        return all(
            mine.contains(g)
            for mine, its in pairs
            for g in (*(translation(vector) for vector in its.lattice.T), *its.cosets)
        )

    def __hash__(self) -> int:
        return hash(self._invariants)

    @cached_property
    def _invariants(self) -> tuple[int, tuple[tuple[int, int, int], ...]]:
        """The dimension, and how many elements of the point group have each trace and determinant.

        Only whole numbers: equality has a tolerance, so a quantity that changes with rounding would
        give some equal groups different hashes.
        """
        unique = np.unique(self.integral_parts, axis=0)
        kinds = np.stack([np.trace(unique, axis1=1, axis2=2), np.linalg.det(unique)], axis=1)
        values, counts = np.unique(np.round(kinds).astype(int), axis=0, return_counts=True)
        rows = zip(values.tolist(), counts.tolist(), strict=True)
        return self.dim, tuple((trace, det, count) for (trace, det), count in rows)

    def contains(self, isometry: Isometry, tolerance: float = TOLERANCE) -> bool:
        """Return whether `isometry` is in the group, within `tolerance` of the cell's size."""
        if isometry.dim != self.dim:
            return False
        offset = (isometry.translation - self.translations) @ self.inverse_lattice.T
        offset -= np.round(offset)
        same_linear = np.abs(self.linear_parts - isometry.linear).max(axis=(1, 2)) <= tolerance
        return bool((same_linear & (np.abs(offset).max(axis=1) <= tolerance)).any())

    def wrap(self, points: Points) -> Points:
        """Move points, shape (..., d), by lattice vectors into the cell B [0, 1)^d.

        Raises `GroupError` for points of another dimension.
        """
        check_dimension(points, self.dim)
        fractional = points @ cast_like(self.inverse_lattice, points).T
        if isinstance(fractional, np.ndarray):
            floor = np.floor(fractional)
        else:
            floor = fractional.detach().floor()
        return points - floor @ cast_like(self.lattice, points).T

    def images(self, points: Points) -> Points:
        """Return images of points (..., d) under the coset representatives, shape (|G|, ..., d).

        Raises `GroupError` for points of another dimension.
        """
        check_dimension(points, self.dim)
        linear, shift = (cast_like(a, points) for a in (self.linear_parts, self.translations))
        flat = points.reshape(1, -1, self.dim)
        moved = flat @ linear.swapaxes(-1, -2) + shift[:, None, :]
        return moved.reshape(self.order, *points.shape)

    def elements_near(
        self, center: ArrayLike, radius: float, *, source: ArrayLike | None = None
    ) -> list[Isometry]:
        """Return all elements that take the point `source` within `radius` of `center`, nearest first.

        With the bounding disc of a tile as source, and radius = tile radius + region radius, these
        are the elements whose image of the tile can meet the region. Both points are (d,); the source
        is by default the centre.
        """
        center = np.asarray(center, dtype=np.float64)
        source = center if source is None else np.asarray(source, dtype=np.float64)
        near: list[tuple[float, Isometry]] = []
        reach = radius * np.linalg.norm(self.inverse_lattice, axis=1)
        for coset in self.cosets:
            middle = self.inverse_lattice @ (center - coset(source))
            ranges: list[Array] = [
                np.arange(np.ceil(m - r), np.floor(m + r) + 1)
                for m, r in zip(middle, reach, strict=True)
            ]
            steps = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, self.dim)
            shifts = steps @ self.lattice.T + coset.translation
            distance = np.linalg.norm(coset.linear @ source + shifts - center, axis=1)
            for i in np.flatnonzero(distance <= radius):
                near.append((float(distance[i]), Isometry(coset.linear, shifts[i])))
        near.sort(key=lambda item: item[0])
        return [element for _, element in near]

    def conjugate(
        self, linear: ArrayLike, offset: ArrayLike | None = None
    ) -> CrystallographicGroup:
        """Return the group M G M^-1 for the affine map M: p -> linear p + offset.

        If a map D commutes with G then M o D carries tiles of G to tiles of M G M^-1. `linear` may
        be any similarity, or any map that commutes with the point group (lattice freedom).

        Raises:
            NotAnIsometryError: if M G M^-1 is not made of isometries.
            GroupError: if `linear` is singular or a shape is wrong.
        """
        m = np.asarray(linear, dtype=np.float64)
        v = np.zeros(self.dim) if offset is None else np.asarray(offset, dtype=np.float64)
        if m.shape != self.lattice.shape or v.shape != (self.dim,):
            raise GroupError(
                f"expected a ({self.dim}, {self.dim}) matrix and a ({self.dim},) offset, got "
                f"shapes {m.shape} and {v.shape}"
            )
        basis = checked_lattice(m @ self.lattice)
        inverse = np.linalg.inv(m)
        cosets: list[Isometry] = []
        for g in self.cosets:
            rotated = m @ g.linear @ inverse
            cosets.append(Isometry(rotated, m @ g.translation + v - rotated @ v))
        return CrystallographicGroup(
            basis, tuple(_reduce_translation(basis, g) for g in cosets), self.name
        )

    def primitive(self) -> CrystallographicGroup:
        """Return the same group on the lattice of all its translations, with one coset for each R.

        A group whose lattice is that already is returned as it is.

        >>> cmm = CrystallographicGroup.generate(np.eye(2), [translation([0.5, 0.5])])
        >>> cmm.order, cmm.primitive().order, round(cmm.primitive().cell_volume, 9)
        (2, 1, 0.5)
        """
        shifts = [g.translation for g in self.cosets if np.allclose(g.linear, np.eye(self.dim))]
        if len(shifts) == 1:
            return self
        basis = checked_lattice(_shortest_basis(self.lattice, np.stack(shifts)))
        one_each: dict[bytes, Isometry] = {}
        for integral, coset in zip(self.integral_parts, self.cosets, strict=True):
            one_each.setdefault(integral.tobytes(), _reduce_translation(basis, coset))
        return CrystallographicGroup(basis, tuple(one_each.values()), self.name)

    def __repr__(self) -> str:
        label = f"{self.name}, " if self.name else ""
        basis = (self.lattice.round(6) + 0.0).tolist()
        return f"CrystallographicGroup({label}order {self.order}, lattice {basis})"


def checked_group(group: object) -> CrystallographicGroup:
    """Return `group` if it is a group; raise `GroupError` if not, such as for a group's name."""
    if isinstance(group, CrystallographicGroup):
        return group
    hint = "see orbiflow.symmetry for groups"
    if isinstance(group, str):
        hint = f"wallpaper_group({group!r}) or identification_group({group!r}) makes one by name"
    raise GroupError(
        f"expected a CrystallographicGroup, got {group!r} of type {type(group).__name__}: {hint}"
    )


def _check_maps_lattice(basis: Array, generator: Isometry, number: int) -> None:
    d = basis.shape[0]
    if generator.dim != d:
        raise GroupError(
            f"generator {number} acts on R^{generator.dim}, but the lattice is in R^{d}"
        )
    integral = np.linalg.solve(basis, generator.linear @ basis)
    deviation = np.abs(integral - np.round(integral)).max()
    if deviation > TOLERANCE:
        raise LatticeMismatchError(
            f"generator {number}, {generator!r}, does not map the lattice to itself: a basis "
            f"vector's image misses the lattice by {deviation:.2e} (fractional). "
            "Change the generator or the lattice."
        )


def _reduce_translation(basis: Array, element: Isometry) -> Isometry:
    fractional = np.linalg.solve(basis, element.translation)
    # translations within rounding of a lattice vector must come out as zero, not as one
    fractional = fractional - np.floor(fractional + TOLERANCE)
    fractional[np.abs(fractional) < TOLERANCE] = 0.0
    return Isometry(element.linear, basis @ fractional)


def _shortest_basis(lattice: Array, shifts: Array) -> Array:
    """Return the first of the shortest vectors that are a basis of a lattice with n shifts in it."""
    d, n = len(lattice), len(shifts)
    parts = np.round(n * np.linalg.solve(lattice, shifts.T).T).astype(np.int64)[:, None]
    nths = (parts + n * (np.indices((3,) * d).reshape(d, -1).T - 1)).reshape(-1, d)
    lengths: Array = np.linalg.norm(nths @ lattice.T, axis=1) / np.linalg.norm(lattice)
    directions: dict[tuple[int, ...], Array] = {}  # the shortest of each; ties in a fixed order
    for v in nths[np.lexsort(np.vstack([-nths.T[::-1], lengths.round(6)]))]:
        key = tuple((v // max(1, np.gcd.reduce(v))).tolist())
        if key[::-1] > (0,) * d:  # of each pair +-v the one whose last component is positive
            directions.setdefault(key, v)
    bases = (np.stack(rows, axis=1) for rows in itertools.combinations(directions.values(), d))
    shortest = next(m for m in bases if abs(round(np.linalg.det(m))) == n ** (d - 1))
    return lattice @ shortest / n


def generated(
    lattice: ArrayLike, isometries: Iterable[Isometry], name: str = "", max_order: int = MAX_ORDER
) -> CrystallographicGroup:
    """Return the group that `generate` makes of many isometries, most of which follow from others."""
    closed = CrystallographicGroup.generate(lattice, name=name)
    chosen: list[Isometry] = []
    for isometry in isometries:  # each that is new at least doubles the order
        if not closed.contains(isometry):
            chosen.append(isometry)
            closed = CrystallographicGroup.generate(lattice, chosen, name=name, max_order=max_order)
    return closed


def _closure(basis: Array, generators: Sequence[Isometry], max_order: int) -> tuple[Isometry, ...]:
    elements = _finite_closure(basis, generators, max_order)
    if elements is not None:
        return elements
    counts = range(1, len(generators) + 1)
    too_many = (n for n in counts if _finite_closure(basis, generators[:n], max_order) is None)
    number = next(too_many) - 1
    raise NotDiscreteError(
        f"the closure modulo the lattice has more than {max_order} elements; generator {number}, "
        f"{generators[number]!r}, is the first that exceeds this with those before it. "
        "With this lattice they do not make a discrete group: check centres, lines and mu."
    )


def _finite_closure(
    basis: Array, generators: Sequence[Isometry], max_order: int
) -> tuple[Isometry, ...] | None:
    """Return all products modulo the lattice, or None if there are more than `max_order`."""
    elements: list[Isometry] = []
    waiting = [identity(basis.shape[0])]
    translations: dict[bytes, list[Array]] = {}  # translations modulo the lattice, by linear part
    for element in waiting:  # grows while it is walked
        integral = np.linalg.solve(basis, element.linear @ basis)
        same = translations.setdefault(np.round(integral).astype(np.int64).tobytes(), [])
        fractional = np.linalg.solve(basis, element.translation)
        offsets = fractional - np.reshape(same, (-1, len(basis)))
        if (np.abs(offsets - np.round(offsets)).max(axis=1) <= 10 * TOLERANCE).any():
            continue
        if len(elements) >= max_order:
            return None
        same.append(fractional)
        elements.append(element)
        waiting += [_reduce_translation(basis, generator @ element) for generator in generators]
    return tuple(elements)


def reduced_basis(lattice: Array) -> Array:
    """Return the shortest basis (columns) of a plane lattice, with an angle of 60 to 120 degrees.

    Lagrange's and Gauss's reduction.

    >>> reduced_basis(np.array([[1.0, 7.0], [0.0, 1.0]])).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    first, second = lattice.T
    while True:
        if first @ first > second @ second:
            first, second = second, first
        steps = round(float(first @ second) / float(first @ first) * (1 - 1e-12))
        if steps == 0:
            return np.stack([first, second], axis=1)
        second = second - steps * first


def group_header(group: CrystallographicGroup) -> dict[str, Any]:
    """Return the lattice (columns are basis vectors) and coset representatives, ready for JSON."""
    return {
        "lattice": group.lattice.tolist(),
        "linear": group.linear_parts.tolist(),
        "translations": group.translations.tolist(),
    }


def group_from_header(header: Mapping[str, Any], name: str = "") -> CrystallographicGroup:
    """Return the group of a `group_header`, bit-identical; raise `GroupError` if it describes none."""
    try:
        lattice, linear, shifts = (
            np.array(header[key], dtype=np.float64) for key in ("lattice", "linear", "translations")
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise GroupError(f"the group's numbers are missing or invalid: {error}") from error
    d, order = len(np.atleast_1d(lattice)), len(np.atleast_1d(linear))
    shapes = (lattice.shape, linear.shape, shifts.shape)
    if shapes != ((d, d), (order, d, d), (order, d)) or not (d <= MAX_DIM and order <= MAX_ORDER):
        raise GroupError(f"the group's tables have invalid shapes {', '.join(map(str, shapes))}")
    cosets = tuple(Isometry(*parts) for parts in zip(linear, shifts, strict=True))
    if not order or not cosets[0].is_close(Isometry(np.eye(d), np.zeros(d))):
        raise GroupError("the group's first coset is not that of the identity")
    closed = generated(lattice, cosets, max_order=order)
    if closed.order != order:
        raise GroupError(f"the group has {order} cosets, of which only {closed.order} differ")
    return CrystallographicGroup(closed.lattice, cosets, str(name)[:MAX_NAME])


@dataclass(frozen=True)
class _ExactGroup:
    """A cache key for a group, equal to another only if their numbers are bit-identical."""

    numbers: tuple[bytes, ...]
    group: CrystallographicGroup = field(compare=False)


Function = TypeVar("Function", bound=Callable[..., Any])


def cached_by_basis(maxsize: int) -> Callable[[Function], Function]:
    """Cache a function of a group, as `lru_cache` does, by the group's exact basis and cosets.

    `lru_cache` would mix up equal groups with different bases, whose Fourier coefficients differ.
    """

    def decorate(function: Function) -> Function:
        @lru_cache(maxsize=maxsize)
        def cached(exact: _ExactGroup, *arguments: Any) -> Any:
            return function(exact.group, *arguments)

        @wraps(function)
        def call(group: CrystallographicGroup, *arguments: Any) -> Any:
            tables = group.lattice, group.linear_parts, group.translations
            return cached(_ExactGroup(tuple(t.tobytes() for t in tables), group), *arguments)

        return cast(Any, call)

    return decorate
