"""Animations of a tile as files: a GIF by Pillow, an MP4 by ffmpeg, an SVG in curves."""

from __future__ import annotations

import io
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import accumulate
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from PIL import Image

from orbiflow.arguments import as_path
from orbiflow.arrays import Array
from orbiflow.drawing import Palette, Raster, limited, palette
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Note, Progress, Sink, ignore, write_atomic
from orbiflow.tiles.motion.kinds import (
    MOVE,
    REST,
    SHOW,
    Frame,
    Motion,
    Places,
    bend,
    eased,
    frames,
    grow,
    morph,
)
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.scene import Numbers
from orbiflow.tiles.tile import EscherTile, TileSource
from orbiflow.tiles.tilings import colouring


def animate(
    tile: TileSource,
    out: str | Path,
    settings: AnimationSettings | None = None,
    *,
    force: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel | None = None,
) -> Path:
    """Write an animation of a tile.

    Args:
        out: The file. Its ending, .gif, .mp4 or .svg, decides the format, unless the settings give one.
        on_event: Called with each `Note` and `Progress`.
        tile, settings, force, cancel: As for `export`, which raises the same errors.
    """
    out, cancel = as_path(out, "the file to animate to"), cancel or Cancel()
    settings, given = (settings or AnimationSettings()).for_file(out), as_tile(tile)

    def told(share: float) -> None:
        cancel.check()
        on_event(Progress(share, "drawing"))

    for note in palette(settings.palette).shortage(colouring(given.tile).count):
        on_event(Note(note))
    content = animation(given, settings, force=force, told=told)
    cancel.check()
    return write_atomic(out, content)


def animation(
    tile: TileSource,
    settings: AnimationSettings | None = None,
    *,
    force: bool = False,
    told: Callable[[float], None] = lambda _: None,
) -> bytes | str:
    """Return the content of the file; `told` hears the share of the work done. Raises as `animate`."""
    settings = (settings or AnimationSettings()).for_file(None)
    if settings.format == "mp4":
        require_ffmpeg()  # before the work
    given, colours = as_tile(tile), palette(settings.palette)
    given.require_certified(force=force, otherwise="so it is not animated; --force animates it")
    made = motion(given, settings)
    told(0.0)
    loop = frames(settings.seconds, settings.fps)
    match settings.file_format:
        case "svg":
            title, name = f"{given.name}: {made.what}", f"{given.name}-{settings.kind}"
            return write_motion_svg(made, colours, seconds=settings.seconds, name=name, title=title)
        case "mp4":
            return write_mp4(made, colours, loop, settings.fps, told)
        case _:
            return write_gif(made, colours, loop, told)


def motion(tile: EscherTile, settings: AnimationSettings) -> Motion:
    """Return what moves, before it is a file."""
    width, aspect = settings.size, settings.aspect
    match settings.kind:
        case "morph":
            steady = settings.format == "svg"
            return morph(tile.tile, width, aspect=aspect, y_down=tile.y_down, steady=steady)
        case "grow":
            return grow(tile.tile, width, aspect=aspect, y_down=tile.y_down)
        case "bend":
            return bend(tile, width, aspect=aspect)


OUTLINE = 0.0016  # width of outlines, as a share of the picture's

ProgressCall = Callable[[float], None]  # called with the share of the work that is done


def picture(motion: Motion, palette: Palette, progress: float) -> Raster:
    """Draw one frame."""
    page, rings = motion.page, list(motion.rings(progress))
    window = (0.0, 0.0, float(page.width), float(page.height))
    raster = Raster(window, page.width, y_down=True, paper=palette.paper)
    width = max(1.0, OUTLINE * page.width)
    growing = [[own] for own in rings if not own[2]]  # below whole tiles, whose lines are on top
    for layer in (*growing, [own for own in rings if own[2]]):
        for ring, colour, _ in layer:
            raster.fill([ring], palette.fill(colour))
        for ring, _, _ in layer:
            raster.line(ring, palette.outline, width, closed=True)
    return raster


def write_gif(motion: Motion, palette: Palette, frames: list[Frame], told: ProgressCall) -> bytes:
    """Return a GIF that repeats for ever, with one palette for all frames."""
    fills = [palette.fill(k) for k in range(int(motion.colours.max(initial=0)) + 1)]
    colours = (palette.paper, *fills, palette.outline)
    # few mixed colours, each of which costs bytes in every frame
    shown = list(_shown(motion, palette, frames, told, lambda image: limited(image, colours, 3)))
    # a GIF counts in hundredths of a second
    ends = [round(100 * end) for end in accumulate(frame.seconds for frame in frames)]
    lasting = np.maximum(np.diff([0, *ends]), 2) * 10
    buffer = io.BytesIO()
    how = {"duration": lasting.tolist(), "loop": 0, "disposal": 1, "optimize": False}
    shown[0].save(buffer, "GIF", save_all=True, append_images=shown[1:], **how)
    return buffer.getvalue()


def require_ffmpeg() -> str:
    """Return the path of ffmpeg, which must be installed."""
    found = shutil.which("ffmpeg")
    if found is None:
        raise OrbiflowError(
            "an MP4 needs ffmpeg, which is not installed (or not on the PATH); install it, or choose "
            "a .gif or .svg"
        )
    return found


def write_mp4(
    motion: Motion, palette: Palette, frames: list[Frame], fps: float, told: ProgressCall
) -> bytes:
    """Return an MP4 (H.264) of one loop, which every player and browser shows."""
    ffmpeg = require_ffmpeg()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "loop.mp4"
        command = [ffmpeg, "-loglevel", "error", "-nostdin", "-y", "-f", "rawvideo"]
        size = f"{motion.page.width}x{motion.page.height}"
        command += ["-pix_fmt", "rgb24", "-s", size, "-r", f"{fps:g}"]
        command += ["-i", "-", "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18"]
        command += ["-movflags", "+faststart", str(out)]
        shown = _shown(motion, palette, frames, told, lambda image: image)
        content = b"".join(
            image.tobytes() * max(1, round(frame.seconds * fps))
            for image, frame in zip(shown, frames, strict=True)
        )
        done = subprocess.run(command, input=content, capture_output=True, check=False)
        if done.returncode or not out.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise OrbiflowError(f"ffmpeg failed: {said[-1] if said else 'without a message'}")
        return out.read_bytes()


def _shown(
    motion: Motion,
    palette: Palette,
    frames: list[Frame],
    told: ProgressCall,
    made: Callable[[Image.Image], Image.Image],
) -> Iterator[Image.Image]:
    """Yield the pictures of a loop, each of which is drawn once."""
    known: dict[float, Image.Image] = {}
    count = len({frame.progress for frame in frames})
    for frame in frames:
        if frame.progress not in known:
            known[frame.progress] = made(picture(motion, palette, frame.progress).image())
            told(len(known) / count)
        yield known[frame.progress]


_EASE, _EVEN = "0.42 0 0.58 1", "0 0 1 1"


def write_motion_svg(
    motion: Motion, palette: Palette, *, seconds: float, name: str, title: str
) -> str:
    """Return an animated SVG; readers who prefer less motion see the tiling at rest."""
    # ids and classes begin with the key, so that a page can hold several animations
    key = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "tile"
    width, height = motion.page.width, motion.page.height
    still = motion.places(1.0)
    # growing tiles lie below whole ones
    order = range(len(motion.colours))[::-1]
    moving = [_copy(motion, still, k, f"{key}-moving", palette, seconds) for k in order]
    grown = replace(motion, births=np.full_like(motion.births, -1.0))
    fixed = [_copy(grown, still, k, f"{key}-still", palette, seconds) for k in reversed(order)]
    stroke = f'stroke="{palette.outline}" stroke-width="{OUTLINE * width:.2f}"'
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" \
width="{width}" height="{height}" role="img" class="{key}">
<title>{escape(title)}</title>
<style>
.{key} .still {{ display: none }}
@media (prefers-reduced-motion: reduce) {{
.{key} .moving {{ display: none }}
.{key} .still {{ display: inline }}
}}
</style>
<defs>
<clipPath id="{key}-page"><rect width="{width}" height="{height}"/></clipPath>
<path id="{key}-still" d="{_path(motion.outline(1.0))}"/>
<path id="{key}-moving" d="{_path(motion.outline(1.0))}">{_changing(motion, seconds)}</path>
</defs>
<g clip-path="url(#{key}-page)" {stroke} stroke-linejoin="round">
<rect width="{width}" height="{height}" fill="{palette.paper}" stroke="none"/>
<g class="moving">
{"".join(moving)}</g>
<g class="still">
{"".join(fixed)}</g>
</g>
</svg>
"""


_number = Numbers(1)


def _path(ring: Array) -> str:
    return "M" + " ".join(f"{_number(x)},{_number(y)}" for x, y in ring.tolist()) + "Z"


def _matrix(linear: Array) -> str:
    return ",".join(Numbers(5)(value) for value in linear.T.ravel())


def _changing(motion: Motion, seconds: float) -> str:
    paths = [_path(motion.outline(key)) for key in motion.keys]
    if len(set(paths)) == 1:
        return ""
    return _animate("animate", 'attributeName="d"', motion.keys, paths, seconds)


def _copy(
    motion: Motion, places: Places, k: int, symbol: str, palette: Palette, seconds: float
) -> str:
    linear, (x, y) = places.linear[k], places.offset[k].tolist()
    use = f'<use href="#{symbol}" fill="{palette.fill(int(motion.colours[k]))}"'
    start, end = motion.births[k].tolist()
    if end <= 0:
        return f'{use} transform="matrix({_matrix(linear)},{_number(x)},{_number(y)})"/>\n'
    keys = [0.0, start, *np.linspace(start, end, 5)[1:-1].tolist(), end, 1.0]
    sizes = [Numbers(3)(eased(float(np.clip((t - start) / (end - start), 0, 1)))) for t in keys]
    grows = _animate(
        "animateTransform", 'attributeName="transform" type="scale"', keys, sizes, seconds
    )
    return (
        f'<g transform="translate({_number(x)},{_number(y)})"><g>{grows}'
        f'{use} transform="matrix({_matrix(linear)},0,0)"/></g></g>\n'
    )


def _animate(
    element: str, what: str, keys: Sequence[float], values: Sequence[str], seconds: float
) -> str:
    """Return an animation there and back, with rests: `values` at these `keys` of the progress."""
    direct = len(keys) == 2
    there = [REST + MOVE * _time(key) for key in keys]
    back = [REST + 2 * MOVE + SHOW - MOVE * _time(key) for key in reversed(keys)]
    times = [0.0, *there, *back, 1.0]
    times[-2:] = [1.0] if times[-2] >= 1 - 1e-9 else times[-2:]
    shown = [values[0], *values, *reversed(values), values[0]][: len(times)]
    way = [_EASE if direct else _EVEN] * (len(keys) - 1)
    splines = [_EVEN, *way, _EVEN, *way, _EVEN][: len(times) - 1]
    mode = f'calcMode="spline" keySplines="{";".join(splines)}"' if direct else 'calcMode="linear"'
    return (
        f'<{element} {what} dur="{seconds:g}s" repeatCount="indefinite" {mode} '
        f'keyTimes="{";".join(Numbers(4)(t) for t in times)}" values="{";".join(shown)}"/>'
    )


def _time(progress: float) -> float:
    """Return the time, 0 to 1 of a way, at which the eased progress is reached: the inverse of `eased`.

    >>> [round(_time(eased(t)), 9) for t in (0.0, 0.2, 0.5, 1.0)]
    [0.0, 0.2, 0.5, 1.0]
    """
    return float(0.5 - np.sin(np.arcsin(1 - 2 * progress) / 3))
