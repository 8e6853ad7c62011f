"""The kinds of cut: to add one, write its scenes in a file here, and name it below and in `cut`."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from orbiflow.tiles.make.jigsaws import jigsaw_scenes
from orbiflow.tiles.make.layout import Layout, tiling_scene
from orbiflow.tiles.make.pieces import pieces_scenes
from orbiflow.tiles.make.skeletons import skeleton_scene
from orbiflow.tiles.make.templates import template_scene
from orbiflow.tiles.page import Scene

EVERY, FIRST, LAST = slice(None), slice(1), slice(-1, None)


class Maker(NamedTuple):
    """How one kind of cut is made."""

    scenes: Callable[[Layout], list[Scene]]
    called: str  # what is counted on its sheets
    calibrated: slice = LAST  # the sheets that have a strip for the calibration mark
    splits: bool = False  # whether a page larger than the bed is split, cutting tiles


MAKERS = {
    "none": Maker(lambda layout: [tiling_scene(layout)], "tiles", splits=True),
    "skeleton": Maker(lambda layout: [skeleton_scene(layout)], "tiles in outline", splits=True),
    "pieces": Maker(pieces_scenes, "pieces", EVERY),
    "jigsaw": Maker(jigsaw_scenes, "pieces of a jigsaw", FIRST),
    "template": Maker(lambda layout: [template_scene(layout)], "template"),
}
