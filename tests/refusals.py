"""Errors and warnings by their class and by what they are about, whatever the words around it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from orbiflow.errors import OrbiflowError


@contextmanager
def refused(*about: object, kind: type[Exception] = OrbiflowError) -> Iterator[Any]:
    """The block raises an error of a kind that names what it is about: settings, values, files, places.

    >>> with refused("dpi", 0):
    ...     raise OrbiflowError("dpi must be above 0, got 0")
    """
    with pytest.raises(kind) as caught:
        yield caught
    names(str(caught.value), *about)


@contextmanager
def warned(*about: object, kind: type[Warning] = UserWarning) -> Iterator[Any]:
    """The block warns once or more, and one of the warnings names what it is about."""
    with pytest.warns(kind) as caught:
        yield caught
    texts = [str(one.message) for one in caught]
    assert any(all(str(word) in text for word in about) for text in texts), (about, texts)


def names(text: str, *about: object) -> None:
    """A text names all that it is about."""
    missing = [word for word in map(str, about) if word not in text]
    assert not missing, f"{missing} not in {text!r}"
