"""An animation as SVG: one outline that changes, and a short line a copy.

It moves by SMIL, in every browser and without scripts. Who asks for less motion
(`prefers-reduced-motion`) sees the tiling and nothing moves; so do programs that know no SMIL.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from xml.sax.saxutils import escape

import numpy as np

from orbiflow.export.motion import Motion, Places
from orbiflow.export.timeline import MOVE, REST, SHOW, eased
from orbiflow.figures.palette import Palette
from orbiflow.symmetry.isometry import Array

_EASE, _EVEN = "0.42 0 0.58 1", "0 0 1 1"


def write_motion_svg(
    motion: Motion, palette: Palette, *, seconds: float, name: str, title: str = ""
) -> str:
    """The SVG document.

    Args:
        motion: a steady one.
        palette: of the fills.
        seconds: of the loop.
        name: in front of all ids and classes, so that several can be in one page.
        title: in words.
    """
    key = re.sub(r"[^A-Za-z0-9]+", "-", name).strip("-").lower() or "tile"
    width, height = motion.width, motion.height
    still = motion.places(1.0)
    # what grows is below what is there
    order = reversed(_all(motion))
    moving = [_copy(motion, still, k, f"{key}-moving", palette, seconds) for k in order]
    fixed = [_still_copy(still, k, f"{key}-still", palette, motion) for k in _all(motion)]
    stroke = f'stroke="{palette.outline}" stroke-width="{0.0016 * width:.2f}"'
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" \
width="{width}" height="{height}" role="img" class="{key}">
<title>{escape(title or motion.what)}</title>
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


def _all(motion: Motion) -> range:
    return range(len(motion.colours))


def _path(ring: Array) -> str:
    return "M" + " ".join(f"{_number(x)},{_number(y)}" for x, y in ring.tolist()) + "Z"


def _number(value: float, decimals: int = 1) -> str:
    text = f"{value:.{decimals}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _matrix(linear: Array) -> str:
    return ",".join(_number(value, 5) for value in linear.T.ravel())


def _changing(motion: Motion, seconds: float) -> str:
    outlines = [motion.outline(key) for key in motion.keys]
    if all(np.array_equal(outlines[0], other) for other in outlines[1:]):
        return ""
    return _animate(
        "animate", 'attributeName="d"', motion.keys, [_path(r) for r in outlines], seconds
    )


def _copy(
    motion: Motion, places: Places, k: int, symbol: str, palette: Palette, seconds: float
) -> str:
    linear, (x, y) = places.linear[k], places.offset[k].tolist()
    use = f'<use href="#{symbol}" fill="{palette.fill(int(motion.colours[k]))}"'
    start, end = motion.births[k].tolist()
    if end <= 0:
        return f'{use} transform="matrix({_matrix(linear)},{_number(x)},{_number(y)})"/>\n'
    keys = [0.0, start, *np.linspace(start, end, 5)[1:-1].tolist(), end, 1.0]
    sizes = [_number(eased(float(np.clip((t - start) / (end - start), 0, 1))), 3) for t in keys]
    grows = _animate(
        "animateTransform", 'attributeName="transform" type="scale"', keys, sizes, seconds
    )
    return (
        f'<g transform="translate({_number(x)},{_number(y)})"><g>{grows}'
        f'{use} transform="matrix({_matrix(linear)},0,0)"/></g></g>\n'
    )


def _still_copy(places: Places, k: int, symbol: str, palette: Palette, motion: Motion) -> str:
    x, y = places.offset[k].tolist()
    return (
        f'<use href="#{symbol}" fill="{palette.fill(int(motion.colours[k]))}" '
        f'transform="matrix({_matrix(places.linear[k])},{_number(x)},{_number(y)})"/>\n'
    )


def _animate(
    element: str, what: str, keys: Sequence[float], values: Sequence[str], seconds: float
) -> str:
    """There and back, with rests: `values` at these values of the progress, 0 to 1."""
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
        f'keyTimes="{";".join(_number(t, 4) for t in times)}" values="{";".join(shown)}"/>'
    )


def _time(progress: float) -> float:
    """When, 0 to 1 of a way, the eased progress is reached: the inverse of `eased`.

    >>> [round(_time(eased(t)), 9) for t in (0.0, 0.2, 0.5, 1.0)]
    [0.0, 0.2, 0.5, 1.0]
    """
    return float(0.5 - np.sin(np.arcsin(1 - 2 * progress) / 3))
