"""The types of arrays, and rectangles of the plane."""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from orbiflow.arguments import as_array
from orbiflow.errors import OrbiflowError

Array: TypeAlias = NDArray[Any]
"""A NumPy array of any dtype and shape."""

Complex: TypeAlias = NDArray[np.complex128]
Integers: TypeAlias = NDArray[np.int64]

Window: TypeAlias = tuple[float, float, float, float]
"""A rectangle (xmin, ymin, xmax, ymax), in the units of the points in it."""


def checked_window(window: Sequence[float]) -> Window:
    """Return `window` as four numbers xmin < xmax and ymin < ymax.

    Raises `OrbiflowError` for anything else.
    """
    try:
        values = as_array(window, "window", (4,)).tolist()
    except OrbiflowError:
        values = [0.0] * 4
    if not (values[0] < values[2] and values[1] < values[3]):
        raise OrbiflowError(
            f"a window is (xmin, ymin, xmax, ymax) with xmin < xmax and ymin < ymax, got {window!r}"
        )
    return values[0], values[1], values[2], values[3]
