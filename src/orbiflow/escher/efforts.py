"""Levels of effort: settings by name, the same three for every search."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any, TypeVar

from orbiflow.errors import OrbiflowError

Settings = TypeVar("Settings")


def settings_for(
    kind: type[Settings],
    efforts: Mapping[str, Mapping[str, Any]],
    effort: str,
    changes: Mapping[str, Any],
) -> Settings:
    """Settings of a level of effort, with changes.

    Args:
        kind: a dataclass of settings.
        efforts: what each level changes, by name.
        effort: the level.
        changes: settings that differ from it, by name.

    Raises:
        OrbiflowError: for an unknown level or setting.
    """
    if effort not in efforts:
        raise OrbiflowError(f"effort must be one of {', '.join(efforts)}, got {effort!r}")
    known = {field.name for field in fields(kind)}  # pyright: ignore[reportArgumentType]
    unknown = [name for name in changes if name not in known]
    if unknown:
        raise OrbiflowError(f"unknown settings {', '.join(unknown)}")
    return kind(**{**efforts[effort], **changes})
