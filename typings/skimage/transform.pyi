from typing import Any

import numpy as np
from numpy.typing import NDArray

def resize(
    image: NDArray[Any], output_shape: tuple[int, ...], *, anti_aliasing: bool | None = None
) -> NDArray[np.float64]: ...
