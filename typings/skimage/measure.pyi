from typing import Any

import numpy as np
from numpy.typing import NDArray

def find_contours(
    image: NDArray[Any], level: float | None = None, fully_connected: str = "low"
) -> list[NDArray[np.float64]]: ...
