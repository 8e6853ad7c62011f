"""The four identification spaces by name."""

from __future__ import annotations

import inspect
from typing import Any

from orbiflow.arguments import is_a
from orbiflow.density.spaces.flat import KleinBottle, Torus
from orbiflow.density.spaces.round import ProjectivePlane, Sphere
from orbiflow.density.spaces.space import Space
from orbiflow.errors import OrbiflowError

CLASSES: dict[str, type[Space]] = {
    kind.name: kind for kind in (Torus, Sphere, KleinBottle, ProjectivePlane)
}
SPACES = tuple(CLASSES)
"""Names of the four spaces."""


def space_class(name: str) -> type[Space]:
    """Return the class of a space, by its name."""
    if not is_a(name, str) or name not in CLASSES:
        raise OrbiflowError(f"unknown space {name!r}; the four are {', '.join(SPACES)}")
    return CLASSES[name]


def make_space(name: str, **options: Any) -> Space:
    """Return a space by its name, with the options of its class.

    >>> make_space("torus", dim=2, unit="degrees")
    Torus(dim=2, unit='degrees')
    """
    kind = space_class(name)
    wrong = [key for key in options if key not in inspect.signature(kind).parameters]
    if wrong:
        raise OrbiflowError(f"the {name} has no option {', '.join(wrong)}")
    return kind(**options)
