"""The types of arrays, and rectangles of the plane."""

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[Any]
"""A NumPy array of any dtype and shape."""

Complex: TypeAlias = NDArray[np.complex128]
Integers: TypeAlias = NDArray[np.int64]

Window: TypeAlias = tuple[float, float, float, float]
"""A rectangle (xmin, ymin, xmax, ymax), in the units of the points in it."""
