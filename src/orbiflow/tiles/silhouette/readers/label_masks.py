"""Label masks: pictures whose numbers are names of regions, and not levels of grey."""

from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from orbiflow.arrays import Array

MAX_INDISTINCT_LEVEL = 10  # of 255: the eye cannot distinguish such levels
MAX_SMALL_LABEL = 40  # three numbers or more, and none larger, are labels if their regions are even
MAX_LABELS = 256
STRIP_PIXELS = 4_000_000  # pixels
VOID_LABEL = 255  # what segmented photographs have along the borders of objects, which is no label
# of the pixels on borders between regions: those of labels that fill no 3 x 3 pixels
MAX_STRAY_SHARE = 0.1

_Mask = NDArray[np.bool_]
VOC_LABELS = 21  # of Pascal VOC: DAVIS has the same colours up to there, and grey ones beyond
COLOUR_ROUNDING = 1  # of 255: so much DAVIS's colours differ
VGA_COLOURS = 7  # of Windows' 16 colours, which are VOC's, too


def label_mask(
    numbers: Array | NDArray[np.integer[Any]], *, are_labels: bool = False
) -> tuple[NDArray[np.uint8], str] | None:
    """Return where the largest label is, 255 and 0 (H, W), and a note; None if these are no labels.

    Labels are small whole numbers, or 0, 1, 2 and so on, each of which fills regions. Levels of grey
    are not: between two levels of an anti-aliased or noisy picture there are others, which fill none.
    The label that most of the border has is the background. What is `VOID_LABEL` beside small labels is
    background, too. Where a palette says that they `are_labels`, they may be large, and lines.
    """
    border = np.concatenate([numbers[0], numbers[-1], numbers[1:-1, 0], numbers[1:-1, -1]])
    values, counts = np.unique(border, return_counts=True)
    background = int(values[counts.argmax()])
    given, numbers = numbers, _without_void(numbers, background)
    low, high = int(numbers.min()), int(numbers.max())
    if low < 0 or high > 65535 or low == high:
        return None
    # by strips: counting takes eight bytes for each pixel
    strips = np.array_split(numbers, 1 + numbers.size // STRIP_PIXELS)
    counts = np.sum([np.bincount(strip.ravel(), minlength=high + 1) for strip in strips], axis=0)
    values = np.flatnonzero(counts)
    n = len(values)
    are_few = are_labels or high <= (
        MAX_INDISTINCT_LEVEL if n == 2 and numbers is given else MAX_SMALL_LABEL
    )
    if n > MAX_LABELS or not (are_few or (n > 2 and low <= 1 and high - low == n - 1)):
        return None
    even = scipy.ndimage.maximum_filter(numbers, 3) == scipy.ndimage.minimum_filter(numbers, 3)
    filling = np.bincount(numbers[even], minlength=len(counts)) > 0
    if not are_labels and counts[~filling].sum() > MAX_STRAY_SHARE * (~even).sum():
        return None
    counts[background] = 0
    label, labelled = int(counts.argmax()), int(counts.sum())
    mask = np.where(numbers == label, 255, 0).astype(np.uint8)
    if n == 2:
        return (
            mask,
            f"label mask: took the pixels of {label} for the shape, of {background} for background",
        )
    share = f"{counts[label] / labelled:.0%} of what is labelled"
    return mask, (
        f"label mask: took label {label}, the largest of {n - 1} ({share}), background {background}; "
        "to take several, give them one label"
    )


def is_of_labels(palette: NDArray[np.int64]) -> bool:
    """Whether a palette (N, 3), of 0 to 255, is that of the label masks of Pascal VOC and DAVIS."""
    return bool(_are_as_in_voc(palette[:VOC_LABELS]).all())


def may_be_labels(indices: NDArray[np.integer[Any]], palette: NDArray[np.int64]) -> bool:
    """Whether the numbers of a picture's colours (H, W) may be labels, by its palette.

    They may be if most of the border is black and has the number 0, and numbers in between are left
    out, which programs that count a picture's colours do not do.
    """
    if _are_as_in_voc(palette[:VGA_COLOURS]).all():  # and no more: Windows' 16 colours
        return False
    used: list[int] = np.unique(indices).tolist()
    edge = np.concatenate([indices[0], indices[-1], indices[1:-1, 0], indices[1:-1, -1]])
    has_gaps = len(used) > 2 and used[-1] > len(used) - 1
    return (
        has_gaps
        and sum(palette[0].tolist()) == 0
        and 2 * int(np.count_nonzero(edge == 0)) > len(edge)
    )


def _are_as_in_voc(palette: NDArray[np.int64]) -> _Mask:
    """Whether colours are Pascal VOC's: bits of a number are red's, green's and blue's in turn."""
    place = np.arange(8)[:, None]
    bits = np.arange(len(palette))[:, None, None] >> (3 * place + np.arange(3)) & 1
    return abs((bits << (7 - place)).sum(axis=1) - palette).max(axis=1) <= COLOUR_ROUNDING


def _without_void(
    numbers: Array | NDArray[np.integer[Any]], background: int
) -> Array | NDArray[np.integer[Any]]:
    """Return numbers with `VOID_LABEL` as background, where what else there is are small labels."""
    if int(numbers.max()) != VOID_LABEL or background > MAX_SMALL_LABEL:
        return numbers
    kept = np.where(numbers == VOID_LABEL, background, numbers)
    labelled = int(np.count_nonzero(kept != background))
    is_border = np.count_nonzero(numbers == VOID_LABEL) < labelled
    return kept if is_border and int(kept.max()) <= MAX_SMALL_LABEL else numbers
