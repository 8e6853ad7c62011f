"""Groups as JSON with their exact bases, in which saved parameters are coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

import numpy as np

from orbiflow.errors import GroupError
from orbiflow.symmetry.group import CrystallographicGroup
from orbiflow.symmetry.isometry import Isometry

MAX_ORDER, MAX_DIM, MAX_NAME = 2048, 64, 200


def group_header(group: CrystallographicGroup) -> dict[str, Any]:
    """Return the lattice (columns are basis vectors) and coset representatives, ready for JSON."""
    return {
        "lattice": group.lattice.tolist(),
        "linear": group.linear_parts.tolist(),
        "translations": group.translations.tolist(),
    }


def group_from_header(header: Mapping[str, Any], name: str = "") -> CrystallographicGroup:
    """Return the group of a `group_header`, with bit-identical basis and representatives.

    Raises:
        GroupError: if the header does not describe a group.
    """
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
    closed = CrystallographicGroup.generate(lattice)
    chosen: list[Isometry] = []
    for coset in cosets:  # each that is new at least doubles the order
        if not closed.contains(coset):
            chosen.append(coset)
            closed = CrystallographicGroup.generate(lattice, chosen, max_order=order)
    if closed.order != order:
        raise GroupError(f"the group has {order} cosets, of which only {closed.order} differ")
    return CrystallographicGroup(closed.lattice, cosets, str(name)[:MAX_NAME])


Rest = ParamSpec("Rest")
Result = TypeVar("Result")


class _ExactGroup:
    """A cache key for a group, equal to another only if their numbers are bit-identical."""

    def __init__(self, group: CrystallographicGroup) -> None:
        self.group = group
        tables = group.lattice, group.linear_parts, group.translations
        self._key = tuple((table.shape, table.tobytes()) for table in tables)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _ExactGroup) and other._key == self._key

    def __hash__(self) -> int:
        return hash(self._key)


def cached_by_basis(
    maxsize: int,
) -> Callable[
    [Callable[Concatenate[CrystallographicGroup, Rest], Result]],
    Callable[Concatenate[CrystallographicGroup, Rest], Result],
]:
    """Cache a function of a group, as `lru_cache` does, by the group's exact basis and cosets.

    `lru_cache` would mix up equal groups with different bases, whose Fourier coefficients differ.
    """

    def decorate(
        function: Callable[Concatenate[CrystallographicGroup, Rest], Result],
    ) -> Callable[Concatenate[CrystallographicGroup, Rest], Result]:
        @lru_cache(maxsize=maxsize)
        def cached(exact: _ExactGroup, /, *args: Rest.args, **kwargs: Rest.kwargs) -> Result:
            return function(exact.group, *args, **kwargs)

        @wraps(function)
        def call(
            group: CrystallographicGroup, /, *args: Rest.args, **kwargs: Rest.kwargs
        ) -> Result:
            return cached(_ExactGroup(group), *args, **kwargs)

        return call

    return decorate
