"""Image files, decoded within bounds to what each pixel shows, whatever its depth and transparency."""

import io
import re
import warnings
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from PIL import Image, UnidentifiedImageError

from orbiflow.errors import InputFileError
from orbiflow.tiles.silhouette.readers.reading import Source, check_file, read_bytes, read_head

MAX_BYTES = 64 * 2**20
MAX_PIXELS = 40_000_000  # that are kept: of a larger image, several become one
MAX_PIXELS_READ = 128_000_000  # before they are shrunk: telephones have 48 or 108 million
MAX_FRAMES = 100  # of an animation, in which one that shows anything is sought
FULL_SCALES = (1.0, 255.0, 1023.0, 4095.0, 16383.0, 65535.0)  # of masks, and of 8 to 16 bits
STRIP_ROWS = 256  # rows of the shrunk image that are made at once
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
# by EXIF orientation
_TURNS = {
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


def image_kind(head: bytes) -> str:
    """Return the kind of an image by its first 12 bytes, such as "PNG"; "" for anything else."""
    if head[:4] == b"RIFF" and head[8:12] == b"WEBP":
        return "WebP"
    return next((kind for start, kind in _STARTS.items() if head.startswith(start)), "")


@dataclass(frozen=True)
class DecodedImage:
    """The first frame of an image file that shows anything, turned as its EXIF orientation asks.

    - `image`: Of mode "L", "RGB", "RGBA" (not premultiplied), or "F" (0 to 1, of more than 8 bits).
    - `size`: The width and height of the image in the file, turned, in pixels.
    - `shrunk`: How many of those pixels are one of `image`'s wide.
    - `notes`: What was decided for the user.
    """

    image: Image.Image
    size: tuple[int, int]
    shrunk: int
    notes: tuple[str, ...]


def open_image(path: Source, *, enough: int | None = None) -> tuple[Image.Image, list[str]]:
    """Return the picture of `decoded_image`, 8 bits deep, and its notes."""
    found = decoded_image(path, enough=enough)
    return _eight_bits(found.image), list(found.notes)


def decoded_image(path: Source, *, enough: int | None = None) -> DecodedImage:
    """Decode an image file.

    With `enough` pixels a side, a JPEG may be decoded to fewer than it has, which is faster.
    Raises `InputFileError` for one that is too large, before a pixel of it is decoded, or damaged.
    """
    check_file(path)
    try:
        with warnings.catch_warnings():
            # Pillow warns of damaged metadata and of sizes that are refused here anyway.
            warnings.simplefilter("ignore")
            with Image.open(_stream(path), formats=_FORMATS) as file:
                return _first_shown(path, file, enough)
    except InputFileError:
        raise
    except Image.DecompressionBombError as exc:
        n_pixels = max(map(int, re.findall(r"\d+", str(exc))), default=0)
        raise InputFileError(_too_large(path, f"{n_pixels / 1e6:.0f} megapixels")) from exc
    except UnidentifiedImageError as exc:
        kind = image_kind(read_head(path, 12))
        named = f"{kind} image".strip()
        why = f"the {named} is damaged or cut short, or it is none; give a PNG, JPEG or WebP image"
        if "TIFF" in kind:
            why = (
                "this kind of TIFF image (such as colours of floating-point numbers) is not read, or "
                "it is damaged; save it as PNG"
            )
        raise InputFileError(f"{path}: {why}") from exc
    except _DAMAGED as exc:
        kind = image_kind(read_head(path, 12))
        raise InputFileError(
            f"{path}: the {kind} image is damaged or cut short ({exc}); export or download it again"
        ) from exc


def _stream(path: Source) -> io.BytesIO:
    """Return a file's bytes: some TIFFs that are turned Pillow misreads where it is given a path."""
    return io.BytesIO(read_bytes(path, MAX_BYTES))


def check_size(path: Source, size: tuple[int, int], most: int = MAX_PIXELS_READ) -> None:
    """Raise InputFileError for a picture of `size` (width, height) that is too large or too small."""
    width, height = size
    if width * height > most:
        pixels = f"{width} x {height} pixels ({width * height / 1e6:.0f} megapixels)"
        raise InputFileError(_too_large(path, pixels, most))
    if width * height < 2:
        raise InputFileError(f"{path}: {width} x {height} pixels cannot hold a silhouette")


def _too_large(path: Source, size: str, most: int = MAX_PIXELS_READ) -> str:
    return f"{path}: {size}, at most {most // 10**6} megapixels are read; downscale the image"


def _first_shown(path: Source, file: Any, enough: int | None) -> DecodedImage:
    """Return the first frame that shows anything, or the first of all."""
    n_frames = getattr(file, "n_frames", 1)
    first: DecodedImage | None = None
    pixels = 0
    for number in range(min(n_frames, MAX_FRAMES)):
        file.seek(number)
        pixels += file.width * file.height
        if first is not None and pixels > MAX_PIXELS_READ:
            break
        other = f"frame {number + 1}, the first that shows anything,"
        which = other if number else "the first frame"
        notes = [f"took {which} of {n_frames}"] * (n_frames > 1)
        found = _frame(path, file, enough, notes)
        if n_frames == 1 or _shows_anything(found.image):
            return found
        first = first or found
    assert first is not None
    return first


def _shows_anything(image: Image.Image) -> bool:
    extrema: Any = image.getextrema()
    bands = [extrema] if len(image.getbands()) == 1 else extrema
    transparent = image.mode == "RGBA" and bands[3][1] == 0
    return not transparent and any(low != high for low, high in bands)


def _frame(path: Source, file: Any, enough: int | None, notes: list[str]) -> DecodedImage:
    is_jpeg = file.format in ("JPEG", "MPO")
    check_size(path, file.size)
    width, height = size = file.size
    stored = str(file.tile[0][3]) if file.format == "PNG" and file.tile else ""
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
    if orientation not in (0, 1):
        notes.append("turned the image as its EXIF orientation asks")
        # Pillow itself turns TIFFs, their size included
        size = (height, width) if orientation >= 5 and file.format != "TIFF" else size
    raw = _loaded(path, file, stored)
    turn = None if file.format == "TIFF" else _TURNS.get(orientation)
    levels = _levels(path, raw.image, notes) if raw.image.mode.startswith(("I", "F")) else None
    factor = max(1, round(shrunk * file.width / width))
    image = raw.shown(levels) if factor == 1 else _shrunk(raw, factor, levels)
    image = image if turn is None else image.transpose(turn)
    if image.mode == "L" and image.getextrema() == (0, 1):
        image = image.point([0, *[255] * 255])
        notes.append(MASK_NOTE)
    return DecodedImage(image, size, shrunk, tuple(notes))


class _Raw(NamedTuple):
    """What Pillow decodes, of any mode; and of a transparent level or colour where it is not, 255."""

    image: Image.Image
    opaque: Image.Image | None = None

    def rows(self, top: int, bottom: int) -> "_Raw":
        """Return some of the rows."""
        box = (0, top, self.image.width, bottom)
        return _Raw(self.image.crop(box), self.opaque and self.opaque.crop(box))

    def shown(self, levels: tuple[float, float] | None) -> Image.Image:
        """Return the image as `DecodedImage` has it, given the levels of its black and white."""
        image = self.image
        if levels is not None:
            black, white = levels
            values = np.asarray(image, dtype=np.float32) - np.float32(black)
            image = Image.fromarray(values / np.float32(white - black))
            if self.opaque is None:
                return image
            image = _eight_bits(image)
        elif self.opaque is None:
            if image.has_transparency_data:
                return image.convert("RGBA")
            return image.convert("L" if image.mode in ("1", "L") else "RGB")
        image = image.convert("RGB")
        image.putalpha(self.opaque)
        return image


def _loaded(path: Source, file: Any, stored: str) -> _Raw:
    """Load the frame that an open file stands at; a PNG has pixels as `stored`, such as "L;2"."""
    file.load()
    key: Any = file.info.get("transparency")
    values = np.asarray(file)
    if file.mode == "RGB" and isinstance(key, tuple):
        own = np.array(cast(Any, key), dtype=int)
        if stored != "RGB;16B":
            own &= 255
        elif getattr(file, "n_frames", 1) > 1:
            own >>= 8
        else:
            with Image.open(_stream(path), formats=_FORMATS) as again:
                again.tile = [again.tile[0]._replace(args="RGB;16L")]  # the other byte of each
                again.load()
                values = values.astype(np.uint16) * 256 + np.asarray(again)
        opaque = (values != own).any(axis=2)
    elif file.mode in ("L", "I;16", "I;16B") and isinstance(key, int):
        bits = 16 if file.mode != "L" else int(stored.partition(";")[2] or 8)
        opaque = values != (key & (2**bits - 1)) * _PNG_SCALES.get(stored, 1)
    else:
        return _Raw(file)
    return _Raw(file, Image.fromarray(np.where(opaque, 255, 0).astype(np.uint8)))


def _levels(path: Source, image: Image.Image, notes: list[str]) -> tuple[float, float]:
    """Return the levels of black and white in an image of more than 8 bits.

    White is the least of `FULL_SCALES` for whole numbers, with a note if that is not of 16 bits. Of
    other numbers none is known: the image's own range stands in for it.
    """
    values = np.asarray(image)
    low, high = float(values.min()), float(values.max())
    if not np.isfinite([low, high]).all():
        raise InputFileError(f"{path}: holds pixels that are not finite numbers; export it as PNG")
    if image.mode == "F" or low < 0 or high > FULL_SCALES[-1]:
        return low, max(high, low + float(np.finfo(np.float32).tiny))
    white = next(scale for scale in FULL_SCALES if high <= scale)
    if high <= 1:
        notes.append(MASK_NOTE)
    elif high <= FULL_SCALES[-2]:
        notes.append(
            f"took {white:.0f} for white: the levels, of 16 bits or more, go up to {high:.0f}"
        )
    return 0.0, white


def _eight_bits(image: Image.Image) -> Image.Image:
    """Return an image of mode "F", 0 to 1, as "L", and any other as it is."""
    if image.mode != "F":
        return image
    return Image.fromarray((np.asarray(image) * 255 + 0.5).astype(np.uint8))


def _shrunk(raw: _Raw, factor: int, levels: tuple[float, float] | None) -> Image.Image:
    """Return the image with `factor` x `factor` pixels averaged into one, by strips: it is large."""
    width, height = raw.image.size
    strips: list[tuple[int, Image.Image]] = []
    for top in range(0, height, STRIP_ROWS * factor):
        strip = raw.rows(top, min(top + STRIP_ROWS * factor, height)).shown(levels)
        strips.append((top // factor, strip.reduce(factor)))
    whole = Image.new(strips[0][1].mode, (-(-width // factor), -(-height // factor)))
    for top, strip in strips:
        whole.paste(strip, (0, top))
    return whole
