from typing import Any

import numpy as np
from numpy.typing import NDArray

def rgb2lab(rgb: NDArray[Any]) -> NDArray[np.float64]: ...
