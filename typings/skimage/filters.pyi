from typing import Any

from numpy.typing import NDArray

def threshold_otsu(image: NDArray[Any], nbins: int = 256) -> float: ...
