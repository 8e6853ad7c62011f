"""Image files, decoded within bounds to what each pixel shows, as Pillow sees it."""

import io
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from PIL import Image, ImageOps, UnidentifiedImageError

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import MAX_BYTES, FileContent, content_of

MAX_PIXELS = 40_000_000  # that are kept: of a larger image, several become one
MAX_PIXELS_READ = 128_000_000  # before they are shrunk: telephones have 48 or 108 million
MASK_NOTE = "took 1 for white: the levels are 0 and 1 alone"
_STARTS = {
    **{b"\x89PNG\r\n\x1a\n": "PNG", b"\xff\xd8\xff": "JPEG", b"BM": "BMP"},
    **{b"GIF87a": "GIF", b"GIF89a": "GIF", b"II*\0": "TIFF", b"MM\0*": "big-endian TIFF"},
}
_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "GIF", "TIFF")
# What Pillow raises on a damaged file depends on the format.
_DAMAGED = (
    *(OSError, SyntaxError, ValueError, EOFError, KeyError, IndexError, TypeError),
    *(OverflowError, MemoryError, ArithmeticError, Image.DecompressionBombError),
)
# by which Pillow scales these levels, but not the transparent one
_PNG_SCALES = {"L;2": 85, "L;4": 17}


def image_kind(head: bytes) -> str:
    """Return the kind of an image by its first 12 bytes, such as "PNG"; "" for anything else."""
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return "WebP"
    return next((kind for start, kind in _STARTS.items() if head.startswith(start)), "")


@dataclass(frozen=True)
class DecodedImage:
    """The first frame of an image file, turned as its EXIF orientation asks.

    - `image`: Of mode "L", "RGB", "RGBA" (not premultiplied), or "F" (0 to 1, of more than 8 bits).
    - `size`: The width and height of the image in the file, turned, in pixels.
    - `shrunk`: How many of those pixels are one of `image`'s wide.
    - `notes`: What was decided for the user.
    """

    image: Image.Image
    size: tuple[int, int]
    shrunk: int
    notes: tuple[str, ...]


def open_image(
    source: Path | FileContent, *, enough: int | None = None
) -> tuple[Image.Image, list[str]]:
    """Return the picture of `decoded_image`, 8 bits deep, and its notes."""
    decoded = decoded_image(source, enough=enough)
    return _eight_bits(decoded.image), list(decoded.notes)


def decoded_image(source: Path | FileContent, *, enough: int | None = None) -> DecodedImage:
    """Decode an image file.

    With `enough` pixels a side, a JPEG may be decoded to fewer than it has, which is faster.
    Raises `InputFileError` for one that is too large, before a pixel of it is decoded, or damaged.
    """
    path = content_of(source)
    kind = image_kind(path.data)
    try:
        with warnings.catch_warnings():
            # Pillow warns of damaged metadata and of sizes that are refused here anyway.
            warnings.simplefilter("ignore")
            # some TIFFs that are turned Pillow misreads where it is given a path
            with Image.open(io.BytesIO(path.within(MAX_BYTES)), formats=_FORMATS) as file:
                return _first_frame(path, file, enough)
    except InputFileError:
        raise
    except Image.DecompressionBombError as exc:
        n_pixels = max(map(int, re.findall(r"\d+", str(exc))), default=0)
        raise InputFileError(_too_large(path, f"{n_pixels / 1e6:.0f} megapixels")) from exc
    except UnidentifiedImageError as exc:
        named = f"{kind} image".strip()
        why = f"the {named} is damaged or cut short, or it is none; give a PNG, JPEG or WebP image"
        if "TIFF" in kind:
            why = (
                "this kind of TIFF image (such as colours of floating-point numbers) is not read, or "
                "it is damaged; save it as PNG"
            )
        raise InputFileError(f"{path}: {why}") from exc
    except _DAMAGED as exc:
        raise InputFileError(
            f"{path}: the {kind} image is damaged or cut short ({exc}); export or download it again"
        ) from exc


def check_size(path: FileContent, size: tuple[int, int], most: int = MAX_PIXELS_READ) -> None:
    """Raise InputFileError for a picture of `size` (width, height) that is too large or too small."""
    width, height = size
    if width * height > most:
        pixels = f"{width} x {height} pixels ({width * height / 1e6:.0f} megapixels)"
        raise InputFileError(_too_large(path, pixels, most))
    if width * height < 2:
        raise InputFileError(f"{path}: {width} x {height} pixels cannot hold a silhouette")


def _too_large(path: FileContent, size: str, most: int = MAX_PIXELS_READ) -> str:
    return f"{path}: {size}, at most {most // 10**6} megapixels are read; downscale the image"


def _first_frame(path: FileContent, file: Any, enough: int | None) -> DecodedImage:
    frames = getattr(file, "n_frames", 1)
    notes = [f"took the first frame of {frames}"] * (frames > 1)
    check_size(path, file.size)
    width, height = size = file.size
    stored = str(file.tile[0][3]) if file.format == "PNG" and file.tile else ""
    is_jpeg = file.format in ("JPEG", "MPO")
    shrunk = 1  # of a JPEG, which is decoded to a half, quarter or eighth, a power of two
    while -(-width // shrunk) * -(-height // shrunk) > MAX_PIXELS:
        shrunk += shrunk if is_jpeg else 1
    if shrunk > 1:
        megapixels = f"{width * height / 1e6:.0f} megapixels"
        notes.append(f"shrank the image of {megapixels}: {shrunk} x {shrunk} pixels became one")
    if is_jpeg and (shrunk > 1 or enough is not None):
        least = enough if enough is not None and shrunk == 1 else min(size) // shrunk
        file.draft("RGB", (least, least))
    orientation = file.getexif().get(0x0112, 1)
    file.load()  # of a TIFF that is turned, Pillow turns pixels and size here, and the EXIF tag goes
    key: Any = file.info.get("transparency")
    if stored == "RGB;16B" and isinstance(key, tuple):  # the pixels have 8 bits by now
        file.info["transparency"] = tuple((np.array(cast(Any, key)) >> 8).tolist())
    elif stored in _PNG_SCALES and isinstance(key, int):
        bits = int(stored.partition(";")[2])
        file.info["transparency"] = (key & (2**bits - 1)) * _PNG_SCALES[stored]
    image = ImageOps.exif_transpose(file)
    if orientation not in (0, 1):
        notes.append("turned the image as its EXIF orientation asks")
        size = size[::-1] if orientation >= 5 and file.format != "TIFF" else size
    image = _shown(path, image).reduce(max(1, round(shrunk * file.width / width)))
    if image.mode == "L" and image.getextrema() == (0, 1):
        image = image.point([0, *[255] * 255])
        notes.append(MASK_NOTE)
    return DecodedImage(image, size, shrunk, tuple(notes))


def _shown(path: FileContent, image: Image.Image) -> Image.Image:
    """Return the image in one of the modes of `DecodedImage`.

    White is 65,535 of levels of 16 bits; of other deep levels the image's own range stands in for it.
    """
    if image.mode.startswith(("I", "F")):
        values = np.asarray(image, dtype=np.float32)
        low, high = float(values.min()), float(values.max())
        if not np.isfinite([low, high]).all():
            raise InputFileError(
                f"{path}: holds pixels that are not finite numbers; export it as PNG"
            )
        if image.mode.startswith("I;16"):
            low, high = 0.0, 65535.0
        shown = Image.fromarray((values - low) / max(high - low, np.finfo(np.float32).tiny))
        key: Any = image.info.get("transparency")
        if key is None:
            return shown
        image = _eight_bits(shown).convert("RGB")
        image.putalpha(Image.fromarray(np.where(values == key, 0, 255).astype(np.uint8)))
    elif image.has_transparency_data:
        return image.convert("RGBA")
    return (
        image if image.mode == "RGBA" else image.convert("L" if image.mode in ("1", "L") else "RGB")
    )


def _eight_bits(image: Image.Image) -> Image.Image:
    """Return an image of mode "F", 0 to 1, as "L", and any other as it is."""
    if image.mode != "F":
        return image
    return Image.fromarray((np.asarray(image) * 255 + 0.5).astype(np.uint8))
