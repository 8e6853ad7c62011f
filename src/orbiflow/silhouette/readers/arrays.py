"""Pictures that are arrays already: masks and gray levels."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image

from orbiflow.arguments import described
from orbiflow.errors import OrbiflowError
from orbiflow.silhouette.readers.raster import (
    Picture,
    averaged,
    check_size,
    checked_threshold,
    choose_shape,
)
from orbiflow.silhouette.readers.reading import Reading
from orbiflow.silhouette.readers.source import Held
from orbiflow.silhouette.readers.tracing import trace


def read_mask_array(
    values: Any,
    name: str = "mask",
    *,
    threshold: float | None = None,
    invert: bool | None = None,
) -> Reading:
    """The outline of the shape in an array (H, W), in pixels with y down, the first row on top.

    Booleans, and integers that are 0 and 1 alone, say where the shape is; with `invert`, where it is
    not. Other integers of 8 or 16 bits are gray levels of that full scale, floats of full scale 1:
    `threshold` and `invert` mean what they do for images (see `read_image`).

    Raises:
        OrbiflowError: for another shape or type, levels out of range, or a setting that does not fit.
        InputFileError: for over 40 megapixels, and an array without a shape of its own.
    """
    checked_threshold(threshold)
    source = Held(b"", name)
    array = _array(values, name)
    check_size(source, (array.shape[1], array.shape[0]))
    levels, is_mask = _levels(array, name)
    if is_mask and threshold is not None:
        raise OrbiflowError(
            f"{name}: threshold parts gray levels, and this is a mask; leave it out"
        )
    channel, reduced = averaged(Image.fromarray(levels))
    size = array.shape[1], array.shape[0]
    notes = (
        [f"averaged {reduced} x {reduced} pixels into one before tracing"] if reduced > 1 else []
    )
    picture = Picture(channel, "mask" if is_mask else "luminance", size, reduced, tuple(notes))
    level, chosen = choose_shape(source, picture, threshold, invert)
    outline, traced = trace(source, level, scale=reduced, size=size)
    return Reading(outline, True, "image", size, (*picture.notes, *chosen, *traced))


def _array(values: Any, name: str) -> NDArray[Any]:
    if isinstance(values, torch.Tensor):
        values = values.detach().cpu().numpy()
    try:
        array = np.asarray(values)
    except ValueError:  # lists of several lengths
        array = np.asarray(None)
    if array.dtype.kind not in "biuf":
        raise OrbiflowError(
            f"{name}: expected an array of booleans or levels, got {described(values)}"
        )
    if array.ndim != 2:
        raise OrbiflowError(
            f"{name}: expected an array (H, W), got shape {array.shape}; of a picture in colour give "
            "one channel, such as pixels[..., 3] for its opacity or pixels.mean(axis=-1)"
        )
    return array


def _levels(array: NDArray[Any], name: str) -> tuple[NDArray[np.float32], bool]:
    """Levels 0 to 1, and whether they say where the shape is."""
    low, high = (array.min(), array.max()) if array.size else (0, 0)
    if array.dtype.kind == "b" or (array.dtype.kind in "iu" and low >= 0 and high <= 1):
        return array.astype(np.float32), True
    full = 1.0
    if array.dtype.kind in "iu":
        full = 255.0 if high <= 255 else 65535.0
        if array.dtype.itemsize == 2 and array.dtype.kind == "u":
            full = 65535.0
    if not (low >= 0 and high <= full and np.isfinite([low, high]).all()):
        what = "0 to 1" if array.dtype.kind == "f" else "0 to 255, or to 65535"
        raise OrbiflowError(
            f"{name}: levels of type {array.dtype} lie from {what}, got {low:g} to {high:g}; scale them"
        )
    return (array / full).astype(np.float32), False
