"""The checks of `orbiflow.arguments` under their former names, until every room uses those."""

from __future__ import annotations

from orbiflow.arguments import as_instance, as_points, as_tensor, as_whole

check_kind, float_tensor, points_tensor = as_instance, as_tensor, as_points


def silent(*_: object) -> None:
    """Show no progress."""


def check_range(name: str, value: object, low: float, high: float, *, integer: bool) -> None:
    """Refuse a value that is not an integer from `low` to `high`."""
    assert integer
    as_whole(value, name, low, high)
