"""The checks of `orbiflow.arguments` under their former names, until every room uses those."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, TypeVar

from orbiflow.arguments import as_instance, as_number, as_points, as_tensor, as_whole

T = TypeVar("T")

float_tensor, points_tensor = as_tensor, as_points


def check_kind(value: Any, kind: type[T], name: str, hint: str = "") -> T:
    """Return `as_instance`, under its former name."""
    return as_instance(value, kind, name, hint)


def silent(*_: object) -> None:
    """Show no progress."""


def check_range(name: str, value: Any, low: float, high: float, *, integer: bool = False) -> None:
    """Refuse a value that is not a number, or an integer, from `low` to `high`."""
    if value == high == math.inf:
        return
    most = None if high == math.inf else high
    if integer:
        as_whole(value, name, low, most)
    else:
        as_number(value, name, low, most)


def check_ranges(
    settings: Any, ranges: Iterable[tuple[str, float, float]], *, integer: bool = False
) -> None:
    """Apply `check_range` to attributes of `settings`."""
    for name, low, high in ranges:
        check_range(name, getattr(settings, name), low, high, integer=integer)


def check_share(value: Any, name: str = "validation") -> None:
    """Refuse a value that is not a number between 0 and 1."""
    as_number(value, name, above=0, below=1)
