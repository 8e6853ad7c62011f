"""A cache for what depends on how a group is written down, not on the group alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, wraps
from typing import Concatenate, ParamSpec, TypeVar

from orbiflow.symmetry.group import CrystallographicGroup

Rest = ParamSpec("Rest")
Result = TypeVar("Result")


class _Written:
    """A group that equals another one only if their numbers are the same, bit for bit."""

    def __init__(self, group: CrystallographicGroup) -> None:
        self.group = group
        tables = group.lattice, group.linear_parts, group.translations
        self._key = tuple((table.shape, table.tobytes()) for table in tables)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Written) and other._key == self._key

    def __hash__(self) -> int:
        return hash(self._key)


def cached_as_written(
    maxsize: int,
) -> Callable[
    [Callable[Concatenate[CrystallographicGroup, Rest], Result]],
    Callable[Concatenate[CrystallographicGroup, Rest], Result],
]:
    """As `lru_cache`, for functions of a group whose result depends on its basis and cosets.

    Groups are equal by value: Fourier coefficients of one are not those of an equal group in another
    basis, so that `lru_cache` would hand out wrong ones.
    """

    def decorate(
        function: Callable[Concatenate[CrystallographicGroup, Rest], Result],
    ) -> Callable[Concatenate[CrystallographicGroup, Rest], Result]:
        @lru_cache(maxsize=maxsize)
        def kept(written: _Written, /, *args: Rest.args, **kwargs: Rest.kwargs) -> Result:
            return function(written.group, *args, **kwargs)

        @wraps(function)
        def call(
            group: CrystallographicGroup, /, *args: Rest.args, **kwargs: Rest.kwargs
        ) -> Result:
            return kept(_Written(group), *args, **kwargs)

        return call

    return decorate
