"""An animation in pixels: a GIF by Pillow, an MP4 by ffmpeg where it is installed."""

from __future__ import annotations

import io
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from itertools import accumulate
from pathlib import Path

import numpy as np
from PIL import Image

from orbiflow.errors import OrbiflowError
from orbiflow.export.motion import Motion
from orbiflow.export.timeline import Frame
from orbiflow.figures.palette import Palette
from orbiflow.figures.raster import Raster, limited

OUTLINE = 0.0016
"""Width of outlines, as a share of the picture's."""

Told = Callable[[float], None]


def picture(motion: Motion, palette: Palette, progress: float) -> Raster:
    """One frame."""
    window = (0.0, 0.0, float(motion.width), float(motion.height))
    raster = Raster(window, motion.width, y_down=True, paper=palette.paper)
    rings = list(motion.rings(progress))
    width = max(1.0, OUTLINE * motion.width)
    for ring, colour, whole in rings:  # what grows is below what is there
        if not whole:
            raster.fill([ring], palette.fill(colour))
            raster.line(ring, palette.outline, width, closed=True)
    for ring, colour, whole in rings:
        if whole:
            raster.fill([ring], palette.fill(colour))
    for ring, _, whole in rings:
        if whole:
            raster.line(ring, palette.outline, width, closed=True)
    return raster


def write_gif(motion: Motion, palette: Palette, frames: list[Frame], told: Told) -> bytes:
    """A GIF that repeats for ever; all frames have one palette.

    Args:
        frames: of the loop.
        told: told the share of the work done.
    """
    fills = [palette.fill(k) for k in range(int(motion.colours.max(initial=0)) + 1)]
    colours = (palette.paper, *fills, palette.outline)
    # few mixtures: each costs bytes in every frame
    shown = list(_shown(motion, palette, frames, told, lambda image: limited(image, colours, 3)))
    # a GIF counts in hundredths of a second
    ends = [round(100 * end) for end in accumulate(frame.seconds for frame in frames)]
    lasting = np.maximum(np.diff([0, *ends]), 2) * 10
    buffer = io.BytesIO()
    shown[0].save(
        buffer,
        "GIF",
        save_all=True,
        append_images=shown[1:],
        duration=lasting.tolist(),
        loop=0,
        disposal=1,
        optimize=False,
    )
    return buffer.getvalue()


def require_ffmpeg() -> str:
    """Path of ffmpeg.

    Raises:
        OrbiflowError: if it is not installed.
    """
    found = shutil.which("ffmpeg")
    if found is None:
        raise OrbiflowError(
            "an MP4 needs ffmpeg, which is not installed (or not on the PATH); install it, or choose "
            "a .gif or .svg"
        )
    return found


def write_mp4(
    motion: Motion, palette: Palette, frames: list[Frame], fps: float, told: Told
) -> bytes:
    """An MP4 (H.264) of one loop, that every player and browser shows.

    Raises:
        OrbiflowError: if ffmpeg is not installed or fails.
    """
    ffmpeg = require_ffmpeg()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "loop.mp4"
        command = [ffmpeg, "-loglevel", "error", "-nostdin", "-y", "-f", "rawvideo"]
        command += ["-pix_fmt", "rgb24", "-s", f"{motion.width}x{motion.height}", "-r", f"{fps:g}"]
        command += ["-i", "-", "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18"]
        command += ["-movflags", "+faststart", str(out)]
        content = b"".join(
            image.tobytes() * max(1, round(frame.seconds * fps))
            for image, frame in zip(
                _shown(motion, palette, frames, told, lambda image: image), frames, strict=True
            )
        )
        done = subprocess.run(command, input=content, capture_output=True, check=False)
        if done.returncode or not out.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise OrbiflowError(f"ffmpeg failed: {said[-1] if said else 'without a word'}")
        return out.read_bytes()


def _shown(
    motion: Motion,
    palette: Palette,
    frames: list[Frame],
    told: Told,
    made: Callable[[Image.Image], Image.Image],
) -> Iterator[Image.Image]:
    """The pictures of a loop; none is drawn twice."""
    known: dict[float, Image.Image] = {}
    count = len({frame.progress for frame in frames})
    for frame in frames:
        if frame.progress not in known:
            known[frame.progress] = made(picture(motion, palette, frame.progress).image())
            told(len(known) / count)
        yield known[frame.progress]
