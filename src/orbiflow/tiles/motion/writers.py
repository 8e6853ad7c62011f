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

from orbiflow.arrays import Array
from orbiflow.drawing import Palette, limited, png_bytes
from orbiflow.errors import OrbiflowError
from orbiflow.tiles.motifs import Over
from orbiflow.tiles.motion.kinds import (
    MOVE,
    REST,
    SHOW,
    Motion,
    Places,
    SeenCopy,
    eased,
    frames,
    motion,
)
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.motion.skins import dressed
from orbiflow.tiles.page import Curve, Layer, Motif, Scene, Style, Uses, rectangle, symbol_of
from orbiflow.tiles.result_file import as_tile
from orbiflow.tiles.tile import TileSource
from orbiflow.tiles.write import Numbers, scene_image

GIF_COLOURS = 128  # of all frames of a GIF that shows pictures

ProgressCall = Callable[[float], None]
"""What is called with the share of the work that is done."""


def animation(
    tile: TileSource,
    settings: AnimationSettings | None = None,
    *overs: Over,
    force: bool = False,
    report: ProgressCall = lambda _: None,
) -> bytes | str:
    """Return the content of the file; `report` hears the share of the work done. Raises as `animate`.

    `overs` are what lies over the silhouette of each of the tile's figures, as `read_over` returns it.
    """
    settings, resolved = (settings or AnimationSettings()).for_file(None), as_tile(tile)
    if settings.format == "mp4":
        require_ffmpeg()  # before the work
    resolved.require_certified(force=force, otherwise="so it is not animated; {force} animates it")
    made = motion(resolved, settings, *overs)
    report(0.0)
    named = replace(made, what=f"{resolved.name}: {made.what}")
    return WRITERS[settings.file_format](named, settings, report)


def frame_scene(motion: Motion, chosen: Palette, progress: float) -> Scene:
    """Return one frame as a scene in pixels, with what lies on tiles: growing ones below whole ones."""
    page, seen = motion.page, list(motion.seen(progress))
    rings, bodies = motion.outlines(progress), motion.bodies(progress)
    symbols = {symbol_of(k): Curve.polyline(ring, closed=True) for k, ring in enumerate(rings)}
    layers = [Layer("paper", "paper", Style(chosen.paper), (rectangle(page.box),))]
    motifs: dict[str, Motif] = {}
    growing = [[copy] for copy in seen if not copy.whole]
    for copies in (*growing, [copy for copy in seen if copy.whole]):
        kinds = sorted({(copy.kind, copy.colour) for copy in copies})
        for kind, colour in kinds:
            mine = [copy for copy in copies if (copy.kind, copy.colour) == (kind, colour)]
            uses = _uses(symbol_of(kind), mine)
            layers.append(Layer("tiles", "tiles", Style(chosen.fill(colour)), (uses,)))
            if motion.dress is not None:
                skin, name = motion.dress.skins[kind], symbol_of(kind, f"skin-{colour}")
                motifs[name] = skin.on(bodies[kind], colour, symbol_of(kind))
                on = replace(uses, symbol=name)
                layers.append(Layer("drawing", "drawing", Style(), (on,)))
        if motion.line.width:
            lines = [
                _uses(symbol_of(k), [copy for copy in copies if copy.kind == k])
                for k in range(len(rings))
            ]
            layers.append(Layer("outlines", "tiles", motion.line, tuple(filter(len, lines))))
    return Scene(*page.size, tuple(layers), symbols, motifs=motifs)


def _uses(symbol: str, copies: Sequence[SeenCopy]) -> Uses:
    """Return copies of a symbol, those that lie alike as of one aspect."""
    linear = np.array([copy.linear for copy in copies]).reshape(-1, 2, 2)
    _, first, which = np.unique(
        np.round(linear.reshape(-1, 4), 9), axis=0, return_index=True, return_inverse=True
    )
    offsets = np.array([copy.offset for copy in copies]).reshape(-1, 2)
    return Uses(symbol, linear[first], which.ravel(), offsets)


def frame_image(motion: Motion, chosen: Palette, progress: float) -> Image.Image:
    """Return one frame."""
    return scene_image(frame_scene(motion, chosen, progress))


def still(
    tile: TileSource,
    settings: AnimationSettings,
    progress: float,
    side: float,
    pictures: Sequence[Path | None] = (),
) -> bytes:
    """Return one frame of an animation as a PNG, its longer side at most so many pixels."""
    resolved, overs = dressed(as_tile(tile), settings, pictures)
    made = motion(resolved, settings.for_file(None), *overs)
    image = frame_image(made, made.palette(settings), progress)
    image.thumbnail((side, side))
    return png_bytes(image)


def write_gif(motion: Motion, settings: AnimationSettings, report: ProgressCall) -> bytes:
    """Return a GIF that repeats for ever, with one palette for all frames."""
    chosen, loop = motion.palette(settings), frames(settings.seconds, settings.fps)
    shown = list(_shown(motion, chosen, loop, report, _limiting(motion, chosen)))
    # a GIF counts in hundredths of a second
    ends = [round(100 * end) for end in accumulate(seconds for _, seconds in loop)]
    lasting = np.maximum(np.diff([0, *ends]), 2) * 10
    buffer = io.BytesIO()
    how = {"duration": lasting.tolist(), "loop": 0, "disposal": 1, "optimize": False}
    shown[0].save(buffer, "GIF", save_all=True, append_images=shown[1:], **how)
    return buffer.getvalue()


def _limiting(motion: Motion, chosen: Palette) -> Callable[[Image.Image], Image.Image]:
    """Return a function that gives frames the same palette of 256 colours at most."""
    if motion.dress is None:
        # few mixed colours, each of which costs bytes in every frame
        fills = [chosen.fill(k) for k in range(int(motion.colours.max(initial=0)) + 1)]
        colours = (chosen.paper, *fills, chosen.outline)
        return lambda image: limited(image, colours, 3)
    ends = [frame_image(motion, chosen, progress) for progress in (0.0, 1.0)]
    width, height = ends[0].size
    both = Image.new("RGB", (width, 2 * height))
    for number, image in enumerate(ends):
        both.paste(image, (0, number * height))
    chart = both.quantize(GIF_COLOURS)
    return lambda image: image.quantize(palette=chart, dither=Image.Dither.NONE)


def require_ffmpeg() -> str:
    """Return the path of ffmpeg, which must be installed."""
    path = shutil.which("ffmpeg")
    if path is None:
        raise OrbiflowError(
            "an MP4 needs ffmpeg, which is not installed (or not on the PATH); install it, or choose "
            "a .gif or .svg"
        )
    return path


def write_mp4(motion: Motion, settings: AnimationSettings, report: ProgressCall) -> bytes:
    """Return an MP4 (H.264) of one loop, which every player and browser shows."""
    ffmpeg, chosen, fps = require_ffmpeg(), motion.palette(settings), settings.fps
    loop = frames(settings.seconds, fps)
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "loop.mp4"
        command = [ffmpeg, "-loglevel", "error", "-nostdin", "-y", "-f", "rawvideo"]
        size = "{:.0f}x{:.0f}".format(*motion.page.size)
        command += ["-pix_fmt", "rgb24", "-s", size, "-r", f"{fps:g}"]
        command += ["-i", "-", "-an", "-c:v", "libx264", "-pix_fmt", "yuv420p", "-crf", "18"]
        command += ["-movflags", "+faststart", str(out)]
        shown = _shown(motion, chosen, loop, report, lambda image: image)
        content = b"".join(
            image.tobytes() * max(1, round(seconds * fps))
            for image, (_, seconds) in zip(shown, loop, strict=True)
        )
        done = subprocess.run(command, input=content, capture_output=True, check=False)
        if done.returncode or not out.is_file():
            said = done.stderr.decode(errors="replace").strip().splitlines()
            raise OrbiflowError(f"ffmpeg failed: {said[-1] if said else 'without a message'}")
        return out.read_bytes()


def _shown(
    motion: Motion,
    chosen: Palette,
    loop: list[tuple[float, float]],
    report: ProgressCall,
    made: Callable[[Image.Image], Image.Image],
) -> Iterator[Image.Image]:
    """Yield the pictures of a loop, each of which is drawn once."""
    pictures: dict[float, Image.Image] = {}
    count = len(dict(loop))
    for progress, _ in loop:
        if progress not in pictures:
            pictures[progress] = made(frame_image(motion, chosen, progress))
            report(len(pictures) / count)
        yield pictures[progress]


_EASE, _EVEN = "0.42 0 0.58 1", "0 0 1 1"


def write_motion_svg(motion: Motion, settings: AnimationSettings, _: ProgressCall) -> str:
    """Return an animated SVG; readers who prefer less motion see the tiling at rest."""
    chosen, seconds = motion.palette(settings), settings.seconds
    # ids and classes begin with the key, so that a page can hold several animations
    name = f"{motion.what.partition(':')[0]}-{settings.kind}"
    key = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "tile"
    width, height = map(round, motion.page.size)
    still = motion.places(1.0)
    # growing tiles lie below whole ones
    order = range(len(motion.colours))[::-1]
    moving = [_copy(motion, still, k, key, "moving", chosen, seconds) for k in order]
    grown = replace(motion, births=np.full_like(motion.births, -1.0))
    fixed = [_copy(grown, still, k, key, "still", chosen, seconds) for k in reversed(order)]
    paths = [
        f'<path id="{symbol_of(k, key)}-still" d="{_path(ring)}"/>\n'
        f'<path id="{symbol_of(k, key)}-moving" d="{_path(ring)}">{_changing(motion, k, seconds)}'
        "</path>\n"
        for k, ring in enumerate(motion.outlines(1.0))
    ]
    stroke = f'stroke="{motion.line.stroke or "none"}" stroke-width="{motion.line.width:.2f}"'
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" \
width="{width}" height="{height}" role="img" class="{key}">
<title>{escape(motion.what)}</title>
<style>
.{key} .still {{ display: none }}
@media (prefers-reduced-motion: reduce) {{
.{key} .moving {{ display: none }}
.{key} .still {{ display: inline }}
}}
</style>
<defs>
<clipPath id="{key}-page"><rect width="{width}" height="{height}"/></clipPath>
{"".join(paths)}</defs>
<g clip-path="url(#{key}-page)" {stroke} stroke-linejoin="round">
<rect width="{width}" height="{height}" fill="{chosen.paper}" stroke="none"/>
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


def _changing(motion: Motion, kind: int, seconds: float) -> str:
    paths = [_path(motion.outlines(key)[kind]) for key in motion.keys]
    if len(set(paths)) == 1:
        return ""
    return _animate("animate", 'attributeName="d"', motion.keys, paths, seconds)


def _copy(
    motion: Motion, places: Places, k: int, key: str, what: str, chosen: Palette, seconds: float
) -> str:
    linear, (x, y) = places.linear[k], places.offset[k].tolist()
    symbol = f"{symbol_of(int(motion.kinds[k]), key)}-{what}"
    use = f'<use href="#{symbol}" fill="{chosen.fill(int(motion.colours[k]))}"'
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


WRITERS: dict[str, Callable[[Motion, AnimationSettings, ProgressCall], bytes | str]] = {
    "gif": write_gif,
    "mp4": write_mp4,
    "svg": write_motion_svg,
}
"""What writes each format: to add one, name it here and in the settings' `format`."""
