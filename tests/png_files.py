"""Pictures as bytes, PNGs of any depth among them, which Pillow does not write."""

import io
import struct
import zlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from PIL import Image

GREY, COLOUR, PALETTE = 0, 2, 3
SIGNATURE = b"\x89PNG\r\n\x1a\n"


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(
    numbers: ArrayLike,
    depth: int,
    kind: int = GREY,
    *,
    transparent: bytes | None = None,
    palette: bytes | None = None,
) -> bytes:
    """A PNG of numbers (H, W) or (H, W, bands), of so many bits each."""
    pixels = np.asarray(numbers)
    height, width = pixels.shape[:2]
    bits = pixels.reshape(height, -1, 1) >> np.arange(depth)[::-1] & 1
    rows = np.packbits(bits.reshape(height, -1).astype(np.uint8), axis=1)
    content = zlib.compress(np.pad(rows, ((0, 0), (1, 0))).tobytes())
    header = struct.pack(">IIBBBBB", width, height, depth, kind, 0, 0, 0)
    optional = ((b"PLTE", palette), (b"tRNS", transparent))
    more = b"".join(chunk(name, body) for name, body in optional if body is not None)
    ends = chunk(b"IDAT", content) + chunk(b"IEND", b"")
    return SIGNATURE + chunk(b"IHDR", header) + more + ends


def promise(width: int, height: int) -> bytes:
    """A PNG that promises so many pixels and holds none."""
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return SIGNATURE + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")


def saved(image: Image.Image, kind: str = "PNG", **options: Any) -> bytes:
    """The bytes of a picture as Pillow saves it, as a file of any kind."""
    stream = io.BytesIO()
    image.save(stream, kind, **options)
    return stream.getvalue()
