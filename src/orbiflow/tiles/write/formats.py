"""The formats of a scene's file: to add one, write its function in a file here and name it below."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Literal

from orbiflow.settings import OneOf, as_choice

if TYPE_CHECKING:
    from orbiflow.tiles.page import Scene

TOLERANCE = 0.01  # usual distance in mm of polylines from a scene's curves

DxfVersion = Literal["r2010", "r12"]
"""Versions of DXF. R12, of 1992, is what old machines read; it has no true colours."""

WRITERS: dict[str, str] = {
    "svg": "orbiflow.tiles.write.svg:write_svg",
    "pdf": "orbiflow.tiles.write.pdf:write_pdf",
    "dxf": "orbiflow.tiles.write.dxf:write_dxf",
    "png": "orbiflow.tiles.write.png:write_png",
    "html": "orbiflow.tiles.write.html:write_html",
    "json": "orbiflow.tiles.write.json:write_json",
}
"""The module and function that write a scene in each format, which is the ending of its files.

A writer takes the scene, in formats of pages several, and by name `tolerance` in mm, of curves, `dpi`,
of pixels, and `dxf`, a version, as far as it has a use for them. It returns the file's content.
"""

SceneFormat = Annotated[str, OneOf(WRITERS)]
"""The name of a format."""

PAGED = frozenset({"pdf"})
"""The formats whose files hold several pages."""

LINES_ALONE = frozenset({"dxf", "json"})
"""The formats that hold no pictures of pixels."""


def write_scene(
    scene: Scene,
    format: str,
    *,
    more: Sequence[Scene] = (),
    tolerance: float = TOLERANCE,
    dpi: float = 300.0,
    dxf: DxfVersion = "r2010",
) -> str | bytes:
    """Return the content of a scene's file.

    Args:
        scene: The scene.
        format: The name of a format.
        more: The pages after the first, in a format of pages.
        tolerance: The distance in mm of polylines from curves, in formats of lines.
        dpi: Pixels an inch, in formats of pixels.
        dxf: The version of DXF.
    """
    module, name = WRITERS[as_choice(format, tuple(WRITERS), "the format")].split(":")
    writer = getattr(import_module(module), name)
    detail = {"tolerance": tolerance, "dpi": dpi, "dxf": dxf}
    accepted = writer.__kwdefaults__ or {}
    return writer(scene, *more, **{key: value for key, value in detail.items() if key in accepted})
