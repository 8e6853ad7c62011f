"""Pictures of a tile that fills space: a sheet from the figure to the stack, and a stack that opens."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence

import numpy as np
from PIL import Image, ImageDraw

from orbiflow.arrays import Array
from orbiflow.drawing import ShadedPart, SolidView, draw_solids, font
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.solid import EscherSolid
from orbiflow.solids.stacks import (
    STACK_PALETTE,
    StackedCopy,
    copy_centers,
    copy_colour,
    lighter,
    stack_of,
)

TARGET_COLOUR, BENT_COLOUR, TILE_COLOUR = "#d8cbb6", "#8fb3b5", STACK_PALETTE.fill(0)

SIDES = (-0.45, -0.85, 0.32), (0.9, -0.4, 0.25), (0.3, 0.9, 0.45)
"""Directions of three views, to the right, backwards and up as the figure stands."""

STACK_SIDE = (-0.55, -0.8, 0.5)

STACK_FACES, FILM_FACES = 16_000, 4_000
"""Triangles of a copy at most, in the picture of a stack and in a film."""

OPENED = 0.75
"""How far the copies of an open stack are moved apart, as a share of their distances."""


def solid_sheet(
    solid: EscherSolid, *, width: int = 1600, copies: int = 18, remark: str = ""
) -> Image.Image:
    """Return a sheet on white: the figure, its bent body, the tile from three sides, and stacks.

    Args:
        solid: A tile that fills space.
        width: The width in pixels; the height is 7/16 of it.
        copies: How many copies are stacked; colours tell the cosets, and copies side by side, apart.
        remark: A sentence below the stack.
    """
    side, height = round(0.1875 * width), round(0.4375 * width)
    large, row = width - 3 * side, height // 2
    bodies = [(solid.target, TARGET_COLOUR), (solid.bent, BENT_COLOUR), (solid.tile, TILE_COLOUR)]
    target, bent, tile = (ShadedPart.smooth(m.points, m.faces, c) for m, c in bodies)
    stack = Stack(solid, copies, STACK_FACES)
    words = ", ".join(filter(None, [f"{copies} copies", solid.group.name]))
    words = f"{words}. {remark}" if remark else words
    panels = [
        ([target], SIDES[0], (side, row), (0, 0), "the figure"),
        ([bent], SIDES[0], (side, row), (side, 0), "bent"),
        ([tile], SIDES[0], (side, row), (2 * side, 0), "the tile"),
        ([tile], SIDES[1], (side, row), (0, row), "from another side"),
        ([tile], SIDES[2], (side, row), (side, row), "from behind"),
        (stack.parts(OPENED), STACK_SIDE, (side, row), (2 * side, row), "the stack, opened"),
        (stack.parts(0.0), STACK_SIDE, (large, height), (3 * side, 0), words),
    ]
    sheet = Image.new("RGB", (width, height), "white")
    letters = font(max(9, round(width / 110)))
    for parts, direction, size, place, words in panels:
        line = round(0.022 * width)
        drawn = draw_solids(parts, (size[0], size[1] - line), _view(solid.upright, direction))
        sheet.paste(drawn, place)
        bottom = place[0] + size[0] / 2, place[1] + size[1] - line
        ImageDraw.Draw(sheet).text(bottom, words, fill="#555555", font=letters, anchor="ma")
    return sheet


def solid_gif(
    solid: EscherSolid,
    *,
    size: int = 480,
    frames: int = 48,
    copies: int = 12,
    seconds: float = 6.0,
    progress: Callable[[float], object] | None = None,
) -> bytes:
    """Return a GIF without end in which a stack turns once round, opens and closes.

    Args:
        solid: A tile that fills space.
        size: Width and height in pixels.
        frames, seconds: How many pictures, and how long one turn takes.
        copies: How many copies are stacked.
        progress: Told after each picture what share is done, 0 to 1.
    """
    stack, drawn = Stack(solid, copies, FILM_FACES), list[Image.Image]()
    for k in range(frames):
        turn = 2 * np.pi * k / frames
        apart = OPENED * (0.5 - 0.5 * np.cos(turn)) ** 1.5
        cos, sin = np.cos(turn), np.sin(turn)
        x, y, z = STACK_SIDE
        view = _view(solid.upright, (cos * x - sin * y, sin * x + cos * y, z))
        parts = stack.parts(apart)
        middle, radius = stack.ball(parts)
        view = SolidView(view.direction, view.up, middle, radius)
        drawn.append(draw_solids(parts, (size, size), view))
        if progress:
            progress((k + 1) / frames)
    few = drawn[:: max(1, frames // 6)]
    strip = Image.new("RGB", (size, size * len(few)))
    for k, picture in enumerate(few):
        strip.paste(picture, (0, k * size))
    colours = strip.quantize(255, Image.Quantize.MEDIANCUT)
    plain = [picture.quantize(palette=colours, dither=Image.Dither.NONE) for picture in drawn]
    buffer, lasts = io.BytesIO(), 1000 * seconds / frames
    plain[0].save(
        buffer, "GIF", save_all=True, append_images=plain[1:], duration=round(lasts), loop=0
    )
    return buffer.getvalue()


class Stack:
    """A stack of copies of a tile, to be drawn closed or taken apart.

    Args:
        solid: A tile that fills space.
        copies: How many copies.
        most_faces: The most triangles that a copy has.
    """

    def __init__(self, solid: EscherSolid, copies: int, most_faces: int) -> None:
        mesh = lighter(solid.tile, most_faces)
        self.copies: list[StackedCopy] = stack_of(solid.group, solid.tile, copies)
        self._centers = copy_centers(solid.tile, self.copies)
        self._part = ShadedPart.smooth(mesh.points, mesh.faces, TILE_COLOUR)
        self._colours = [copy_colour(solid.group, copy) for copy in self.copies]

    def parts(self, apart: float) -> list[ShadedPart]:
        """Return all copies, moved apart by this share of their distances from the middle."""
        shifts = apart * (self._centers - self._centers.mean(axis=0))
        return [
            self._part.moved(copy.linear, copy.shift + shift).coloured(colour)
            for copy, shift, colour in zip(self.copies, shifts, self._colours, strict=True)
        ]

    def ball(self, parts: Sequence[ShadedPart]) -> tuple[tuple[float, float, float], float]:
        """Return the middle of the stack, and how far its parts reach from there."""
        places = np.concatenate([part.corners.reshape(-1, 3) for part in parts])
        x, y, z = self._centers.mean(axis=0).tolist()
        return (x, y, z), float(np.linalg.norm(places - (x, y, z), axis=1).max())


def figure_axes(figure: Mesh) -> Array:
    """Return directions (3, 3), as columns, that are right, backwards and up for a figure of any pose.

    It is seen from its broad side: the widest of its principal axes is to the right, the least one
    points backwards, and the third up. Of a tall figure the widest is up.
    """
    around = figure.corners.mean(axis=1) - figure.centroid
    areas = np.linalg.norm(figure.face_vectors, axis=1)
    sizes, axes = np.linalg.eigh(around.T @ (areas[:, None] * around))
    depth, middle, widest = axes.T
    right, up = (middle, widest) if sizes[2] > 6 * sizes[1] else (widest, middle)
    up = up if up[np.abs(up).argmax()] > 0 else -up
    right = right if np.linalg.det(np.stack([right, depth, up])) > 0 else -right
    return np.stack([right, depth, up], axis=1)


def _view(axes: Array, direction: tuple[float, float, float]) -> SolidView:
    """Return the view from a direction that is given as the figure stands."""
    x, y, z = (axes @ np.asarray(direction)).tolist()
    up_x, up_y, up_z = axes[:, 2].tolist()
    return SolidView((x, y, z), (up_x, up_y, up_z))
