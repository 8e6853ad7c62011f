"""The formats of a scene's file: to add one, write its function in a file here and name it below."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Literal

from orbiflow.arguments import as_choice

if TYPE_CHECKING:
    from orbiflow.tiles.page import Scene

TOLERANCE = 0.01  # usual distance in mm of polylines from a scene's curves

SceneFormat = Literal["svg", "pdf", "dxf", "png", "json"]
"""The formats, which are endings of files."""

WRITERS: Mapping[str, str] = {
    "svg": "svg:write_svg",
    "pdf": "pdf:write_pdf",
    "dxf": "dxf:write_dxf",
    "png": "png:write_png",
    "json": "json:write_json",
}
"""The file and function that write a scene in each format.

A writer takes the scene, and by name `tolerance` in mm, of curves, and `dpi`, of pixels, as far as it
has a use for them. It returns the file's content.
"""

LINES_ALONE: frozenset[SceneFormat] = frozenset({"dxf", "json"})
"""The formats that hold no pictures of pixels."""


def write_scene(scene: Scene, format: str, **detail: Any) -> str | bytes:
    """Return the content of a scene's file; `detail` is what the format's writer takes."""
    file, name = WRITERS[as_choice(format, tuple(WRITERS), "the format")].split(":")
    writer = getattr(import_module(f"{__package__}.{file}"), name)
    known = writer.__kwdefaults__ or {}
    return writer(scene, **{key: value for key, value in detail.items() if key in known})
