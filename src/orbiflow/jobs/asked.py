"""From a request's fields to a room's settings."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from orbiflow.errors import OrbiflowError
from orbiflow.jobs.request import Request
from orbiflow.runtime import RecordError

Value = TypeVar("Value")


def given(request: Request, names: Iterable[str]) -> dict[str, Any]:
    """The fields of these names that were set, by their names: the others keep their defaults.

    >>> from orbiflow.jobs import EscherizeRequest
    >>> given(EscherizeRequest(image="a.png", strength=None, turns=None, seed=3), ("seed", "turns"))
    {'seed': 3}
    """
    values = {name: getattr(request, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def samples_asked(request: Request, masses: Iterable[float] = (), field: str = "samples") -> int:
    """How many samples regions of these masses get, by the request's field.

    Raises:
        RecordError: where these are too few, by the field's name.
    """
    from orbiflow.density import samples_for

    try:
        return samples_for(masses, getattr(request, field), name=f"{{{field}}}")
    except OrbiflowError as error:
        raise RecordError(str(error)) from error


def read_as(name: str, read: Callable[[str], Value], text: str) -> Value:
    """A field's text, read.

    Raises:
        RecordError: where `read` raises an `OrbiflowError`, with the field's name before it.
    """
    try:
        return read(text)
    except OrbiflowError as error:
        # what the user wrote must not be taken for a field's name
        said = str(error).replace("{", "(").replace("}", ")")
        raise RecordError(f"{{{name}}} {said}") from error
