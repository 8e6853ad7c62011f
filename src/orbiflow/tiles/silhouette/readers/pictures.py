"""Images: the choice of which part of the picture is the shape.

Masks are pictures whose light or opaque part is selected.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.errors import Advice, InputFileError, OrbiflowError, literal
from orbiflow.settings import described, is_tensor
from orbiflow.tiles.silhouette.readers.image_files import MAX_PIXELS, check_size, decoded_image
from orbiflow.tiles.silhouette.readers.photographs import is_photograph, shape_in, threshold_of
from orbiflow.tiles.silhouette.readers.reading import FileContent, Reading
from orbiflow.tiles.silhouette.readers.tracing import Level, trace

MAX_SIDE = 1500  # pixels; beyond this an image is averaged down before it is traced
MAX_SIDE_OF_PHOTOGRAPH = 1000  # pixels, in the same way
MIN_SIDE_OF_PHOTOGRAPH = 16
MIN_TRANSPARENT = 0.005  # of the picture: less, such as rounded corners, cuts nothing out
MIN_CONTRAST = 0.04  # of full scale, between the shape's and the background's usual level
MAX_SOLID_SHARE = 0.1  # of the ink in thin lines: what of it has ink on all sides
NOISE_FACTOR = 4.0  # times the usual deviation of the background
FAINT_INK = 0.15  # of the usual ink: what is fainter is background beside thin lines
# channels that say by themselves where the shape is: their high part and their low part
_PARTS = {
    "alpha": ("what is not transparent", "what is transparent"),
    "mask": ("what is marked", "what is not marked"),
}


@dataclass(frozen=True)
class ImageChannel:
    """One channel of an image."""

    channel: Array  # (H, W), 0 to 1
    name: str  # "luminance"; or "alpha", "mask" or "photograph", whose high part is the shape
    size: tuple[int, int]
    reduced: int  # how many pixels of the image are one of the channel's wide
    notes: tuple[str, ...]


def read_image(
    path: FileContent, *, threshold: float | None = None, invert: bool | None = None
) -> Reading:
    """Read the outline of the shape in a PNG, JPEG or WebP image, in pixels with y down.

    The shape is the opaque part where enough of the image is transparent and some is opaque, else it is
    distinguished from the background, which most of the border is: in a drawing by its luminance, in
    a photograph by its colours. `threshold`, between 0 and 1, is the luminance (or opacity) that
    parts them; with `invert` the shape is the light (or transparent) part; with either, a photograph
    is read like a drawing. Coordinates are those of the image turned as its EXIF orientation asks.
    """
    decoded = decoded_image(path)
    image, notes = decoded.image, [*decoded.notes]
    if _is_hardly_cut_out(image):
        image, notes = _on_white(image), [*notes, "took the few transparent pixels for white"]
    band, name, band_notes = _channel(path, image)
    picture = None
    if threshold is None and invert is None and name == "luminance":
        colours = band if band_notes or band.mode == "F" else image.convert("RGB")
        picture = _photograph(path, colours, (*notes, *band_notes))
    picture = picture or _drawing(band, name, notes, band_notes)
    picture = replace(picture, size=decoded.size, reduced=picture.reduced * decoded.shrunk)
    return _traced(path, picture, threshold, invert)


def _traced(
    path: FileContent, picture: ImageChannel, threshold: float | None, invert: bool | None
) -> Reading:
    if threshold is not None and not (isinstance(threshold, Real) and 0 < threshold < 1):
        raise OrbiflowError(f"threshold must lie between 0 and 1, got {threshold}")
    level, notes = choose_shape(path, picture, threshold, invert)
    outline, seen, traced = trace(path, level, scale=picture.reduced, size=picture.size)
    notes = (*picture.notes, *notes, *traced)
    return Reading(outline, True, "image", picture.size, notes, seen=seen)


def _reduced(band: Image.Image, most: int = MAX_SIDE) -> tuple[Array, int, list[str]]:
    """Return levels 0 to 1 with at most so many pixels a side, how many became one, and a note."""
    reduced = -(-max(band.size) // most)
    full_scale = 1.0 if band.mode == "F" else 255.0
    note = f"made the picture smaller to read it: {reduced} x {reduced} pixels became one"
    levels = np.asarray(band.reduce(reduced), dtype=np.float64) / full_scale
    return levels, reduced, [note] * (reduced > 1)


def _drawing(
    band: Image.Image, name: str, notes: Sequence[str] = (), more: Sequence[str] = ()
) -> ImageChannel:
    channel, reduced, averaging = _reduced(band)
    return ImageChannel(channel, name, band.size, reduced, (*notes, *averaging, *more))


def _photograph(path: FileContent, image: Image.Image, notes: Sequence[str]) -> ImageChannel | None:
    """Return how far each pixel belongs to the shape, or None for a drawing in two colours."""
    levels, reduced, averaging = _reduced(image, MAX_SIDE_OF_PHOTOGRAPH)
    rgb = levels if levels.ndim == 3 else np.repeat(levels[..., None], 3, axis=2)
    if min(rgb.shape[:2]) < MIN_SIDE_OF_PHOTOGRAPH or not is_photograph(rgb):
        return None
    channel = shape_in(rgb)
    if not (channel > 0.5).any():
        raise InputFileError(
            f"{path}: no shape stands out in the photograph; cut it out, photograph it on a plain "
            "ground of another colour, or set a threshold"
        )
    return ImageChannel(channel, "photograph", image.size, reduced, (*notes, *averaging))


def _channel(path: FileContent, image: Image.Image) -> tuple[Image.Image, str, list[str]]:
    """Return the channel that shows the shape."""
    if image.mode != "RGBA":
        return (image if image.mode == "F" else image.convert("L")), "luminance", []
    alpha = image.getchannel("A")
    low, high = np.asarray(alpha.getextrema()).tolist()
    if high == 0:
        extrema: Any = image.convert("RGB").getextrema()
        shows = any(least < most - MIN_CONTRAST * 255 for least, most in extrema)
        cure = "; its colours have one: save it without transparency (without an alpha channel)"
        text = "the image is wholly transparent; there is no shape in it"
        raise InputFileError(f"{path}: {text}{cure * shows}")
    if low == 255:
        return image.convert("RGB").convert("L"), "luminance", []
    if low < 128 <= high:
        return alpha, "alpha", []
    laid = ["laid the half-transparent image on white"]
    return _on_white(image).convert("L"), "luminance", laid


def _on_white(image: Image.Image) -> Image.Image:
    white = Image.new("RGBA", image.size, "white")
    return Image.alpha_composite(white, image).convert("RGB")


def _is_hardly_cut_out(image: Image.Image) -> bool:
    """Whether some pixels are transparent, but too few for a background, and the rest has a shape."""
    if image.mode != "RGBA":
        return False
    rgba = np.asarray(image)
    opaque = rgba[..., 3] >= 128
    return 1 - MIN_TRANSPARENT < opaque.mean() < 1 and np.ptp(rgba[opaque][:, :3], axis=0).any()


def choose_shape(
    path: FileContent, picture: ImageChannel, threshold: float | None, invert: bool | None
) -> tuple[Level, list[str]]:
    """Return the level turned so that the shape is high, and notes of how it was distinguished."""
    channel = picture.channel
    if channel.min() == channel.max():
        raise InputFileError(
            f"{path}: the picture is empty, it is the same all over, so there is no shape in it; give "
            "another one"
        )
    cut = _cut(path, picture) if threshold is None else threshold
    suffix = "" if threshold is None else ", as given"
    above = channel > cut
    if above.all() or not above.any():
        side = "above" if above.any() else "below"
        raise InputFileError(
            f"{path}: every pixel lies {side} the threshold {cut:.2f} ({picture.name} from "
            f"{channel.min():.2f} to {channel.max():.2f}); choose one in between"
        )
    high = np.median(channel[above])
    low = np.median(channel[~above])
    if picture.name == "photograph":
        take_high = True
        notes = [
            "photograph: shape and background were distinguished by colour; check that no shadow "
            "belongs to the shape"
        ]
    elif picture.name in _PARTS:
        take_high = not invert
        part = _PARTS[picture.name][not take_high]
        notes = [f"the shape is {part} (edge at {cut:.2f}{suffix})"]
    else:
        take_high, notes = _polarity(above, invert, f"edge at {cut:.2f}{suffix}")
    level = (
        Level(channel, cut, float(high))
        if take_high
        else Level(1 - channel, 1 - cut, 1 - float(low))
    )
    return (_with_whole_lines(level) if threshold is None else level), notes


def _with_whole_lines(level: Level) -> Level:
    """Return the level of a drawing in thin lines cut near its background, so that none breaks.

    An anti-aliased line of a pixel is no darker than half of its ink where it lies between two.
    """
    ink = level.values > level.cut
    if scipy.ndimage.binary_erosion(ink).sum() > MAX_SOLID_SHARE * ink.sum():
        return level
    ground = level.values[~ink]
    background = float(np.median(ground))
    noise = NOISE_FACTOR * float(np.median(abs(ground - background)))
    return replace(level, cut=background + max(FAINT_INK * (level.inside - background), noise))


def _cut(path: FileContent, picture: ImageChannel) -> float:
    """Return level midway between the usual levels of the two classes that Otsu's method finds."""
    if picture.name != "luminance":
        return 0.5
    channel = picture.channel
    above = channel > threshold_of(channel)
    low, high = float(np.median(channel[~above])), float(np.median(channel[above]))
    if high - low < MIN_CONTRAST:
        raise InputFileError(
            Advice(
                literal(f"{path}: the image is all but blank")
                + f", its luminance is {low:.2f} to {high:.2f}; raise the contrast, save the shape as "
                "a mask, white on black, or try another {threshold}"
            )
        )
    return (low + high) / 2


def _polarity(above: NDArray[np.bool_], invert: bool | None, edge: str) -> tuple[bool, list[str]]:
    """Return whether the shape is the light part."""
    border = np.concatenate([above[0], above[-1], above[1:-1, 0], above[1:-1, -1]])
    light = float(border.mean())
    shape_is_light = light < 0.5 if invert is None else invert
    kind = "light on dark" if shape_is_light else "dark on light"
    how = "detected" if invert is None else "as set"
    notes = [f"shape {how}: {kind} ({edge})"]
    if invert is None and 0.3 < light < 0.7:
        notes.append(
            Advice(
                f"only {max(light, 1 - light):.0%} of the image's border is background; if the "
                "wrong part was taken, try another {invert}"
            )
        )
    return shape_is_light, notes


def read_mask_array(
    values: Any, name: str = "mask", *, threshold: float | None = None, invert: bool | None = None
) -> Reading:
    """Return the outline of the shape in an array (H, W), in pixels with y down.

    Booleans, and integers that are 0 and 1 alone, say where the shape is; with `invert`, where it
    is not. Other integers of 8 or 16 bits are gray levels of that full scale, floats of full scale 1:
    `threshold` and `invert` mean what they do for images (see `read_image`).

    Raises:
        OrbiflowError: for another shape or type, levels out of range, or a setting that does not fit.
        InputFileError: for over 40 megapixels, and an array without a shape of its own.
    """
    source = FileContent(b"", name)
    array = _array(values, name)
    check_size(source, array.shape[::-1], MAX_PIXELS)
    levels, is_mask = _levels(array, name)
    if is_mask and threshold is not None:
        raise OrbiflowError(
            f"{name}: threshold parts gray levels, and this is a mask; leave it out"
        )
    band = Image.fromarray(levels)
    by_colour = not is_mask and threshold is None and invert is None
    picture = _photograph(source, band, ()) if by_colour else None
    picture = picture or _drawing(band, "mask" if is_mask else "luminance")
    return _traced(source, picture, threshold, invert)


def _array(values: Any, name: str) -> Array:
    if is_tensor(values):
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


def _levels(array: Array, name: str) -> tuple[NDArray[np.float32], bool]:
    """Return levels 0 to 1, and whether they say where the shape is."""
    low, high = (array.min(), array.max()) if array.size else (0, 0)
    if array.dtype.kind == "b" or (array.dtype.kind in "iu" and low >= 0 and high <= 1):
        return array.astype(np.float32), True
    full = 65535.0 if high > 255 or array.dtype == np.uint16 else 255.0
    if array.dtype.kind == "f":
        full = 1.0
    if not (low >= 0 and high <= full and np.isfinite([low, high]).all()):
        what = "0 to 1" if array.dtype.kind == "f" else "0 to 255, or to 65535"
        raise OrbiflowError(
            f"{name}: levels of type {array.dtype} lie from {what}, got {low:g} to {high:g}; scale them"
        )
    return (array / full).astype(np.float32), False


_PAINT = "paint what must survive white and the rest black"


def read_mask(path: Path | FileContent) -> ImageChannel:
    """Read a mask from an image: its opacity where some is more transparent, else its luminance."""
    decoded = decoded_image(path)
    image, notes = decoded.image, [*decoded.notes]
    band = image if image.mode == "F" else image.convert("RGB").convert("L")
    if image.mode == "RGBA":
        alpha = image.getchannel("A")
        least, most = np.asarray(alpha.getextrema()).tolist()
        if most < MIN_CONTRAST * 255:
            raise InputFileError(
                f"{path}: the mask is wholly transparent and emphasises nothing; paint what must "
                "survive opaque"
            )
        if most - least >= MIN_CONTRAST * 255:
            band = alpha
            notes.append("took the mask's alpha channel: opaque is emphasised, whatever its colour")
    levels, reduced, _ = _reduced(band)
    low, high = float(levels.min()), float(levels.max())
    if high < MIN_CONTRAST:
        raise InputFileError(f"{path}: the mask is all black and emphasises nothing; {_PAINT}")
    if high - low < MIN_CONTRAST:
        raise InputFileError(
            f"{path}: the mask is uniform, its levels are {low:.2f} to {high:.2f} of white, and "
            f"emphasises nothing above the rest; {_PAINT}"
        )
    return ImageChannel(levels, "mask", decoded.size, reduced * decoded.shrunk, tuple(notes))
