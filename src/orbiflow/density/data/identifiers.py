"""Columns that number the rows, by their names or their values."""

from __future__ import annotations

import re

import numpy as np

from orbiflow.arrays import Array
from orbiflow.density.data.names import is_angle_named

IDENTIFIER_NAMES = frozenset(
    {
        "#",
        "id",
        "idx",
        "index",
        "key",
        "no",
        "no.",
        "nr",
        "number",
        "row",
        "resid",
        "resi",
        "resseq",
    }
)
"""Names of columns that number the rows with any different whole numbers."""

INDEX_NAMES = re.compile(r"|unnamed: \d+|__index_level_\d+__|level_\d+")
"""Names that pandas gives to an index when it writes it: any whole numbers there are no data."""


def is_identifier(name: str, values: Array) -> bool:
    """Return whether a column (N,) numbers the rows, one by one or by its name.

    One that is called after an angle does not.

    >>> is_identifier("item", np.arange(5.0)), is_identifier("item", np.array([1.0, 1.0, 2.0]))
    (True, False)
    >>> is_identifier("phi", np.arange(5.0))
    False
    """
    if len(values) < 3 or not bool((values == np.round(values)).all()) or is_angle_named(name):
        return False
    if bool((np.diff(values) == 1).all()):
        return True
    word = name.strip().casefold()
    if INDEX_NAMES.fullmatch(word):
        return True
    named = word in IDENTIFIER_NAMES or word.endswith(("_id", " id"))
    return named and len(np.unique(values)) == len(values)
