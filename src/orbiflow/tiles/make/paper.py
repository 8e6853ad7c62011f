"""Pages larger than a printer's paper, on whole sheets of paper that are put together."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np

from orbiflow.errors import OrbiflowError
from orbiflow.tiles.make.export_settings import PRINTER_EDGE, ExportSettings
from orbiflow.tiles.make.layout import BLACK, BLUE
from orbiflow.tiles.make.sheets import (
    OVERLAP,
    Spans,
    millimetre_rule,
    require_few,
    sheets_of,
    spans,
)
from orbiflow.tiles.page import Box, Layer, Scene, Style, Words, rectangle

LEAST_OVERLAP = 3.0  # in mm: what a pair of scissors needs, where less than usual saves sheets
LABEL = 2.6  # height in mm of the letters of a sheet's number
SIDE, FOOT = 16.0, 10.0  # width and height in mm of a label beside a picture and below it
MAP = 7.0  # length in mm of the longer side of the small map of the sheets
CLEAR = 2.0  # distance in mm of a label from the picture


@dataclass(frozen=True)
class PaperGrid:
    """How a page is laid on sheets of paper.

    - `paper`: The width and height in mm of each sheet.
    - `columns`, `rows`: The parts of the page that sheets show.
    - `beside`: Whether a sheet's label is beside its picture, or below it.
    """

    paper: tuple[float, float]
    columns: Spans
    rows: Spans
    beside: bool

    @property
    def sheets(self) -> int:
        """The number of sheets."""
        return len(self.columns) * len(self.rows)


def paper_grid(
    size: tuple[float, float], paper: tuple[float, float], overlap: float | None
) -> PaperGrid:
    """Return the way of laying a page on sheets of paper, upright or not, that takes fewest of them.

    All that is drawn keeps `PRINTER_EDGE` from the paper's edge, which printers leave empty. Without
    an overlap it is `OVERLAP`, or as much as is left, `LEAST_OVERLAP` or more, if that saves sheets.

    >>> grid = paper_grid((420.0, 594.0), (210.0, 297.0), None)
    >>> grid.paper, len(grid.columns), len(grid.rows)
    ((297.0, 210.0), 2, 3)
    """

    def laid(paper: tuple[float, float], beside: bool) -> PaperGrid:
        width, height = (side - 2 * PRINTER_EDGE for side in paper)
        room = (width - SIDE, height) if beside else (width, height - FOOT)
        columns, rows = (
            spans(length, side, _overlap(length, side) if overlap is None else overlap)
            for length, side in zip(size, room, strict=True)
        )
        return PaperGrid(paper, columns, rows, beside)

    if min(paper) < 2 * PRINTER_EDGE + SIDE + 3 * max(OVERLAP, overlap or 0.0):
        raise OrbiflowError(
            f"paper of {paper[0]:g} x {paper[1]:g} mm is too small to put a page together of its "
            "sheets; choose larger paper or a smaller overlap"
        )
    ways = product((paper, (paper[1], paper[0])), (True, False))
    best = min((laid(*way) for way in ways), key=lambda grid: grid.sheets)
    require_few(best.sheets)
    return best


def _overlap(length: float, room: float) -> float:
    """Return the usual overlap of sheets along a side, or a smaller one if that saves sheets."""
    count = max(2, math.ceil((length - LEAST_OVERLAP) / (room - LEAST_OVERLAP) - 1e-9))
    return min(OVERLAP, (count * room - length) / (count - 1))


def paper_sheets(scene: Scene, settings: ExportSettings) -> list[Scene]:
    """Return a scene for each sheet of paper of the size `bed`, row by row; one if that holds all.

    Neighbours show the strip that they share both, with the same crosses in it. Each sheet has a label
    with its number, its row and column, and a small map.
    """
    paper = settings.bed
    if paper is None or any(
        scene.width <= width and scene.height <= height for width, height in (paper, paper[::-1])
    ):
        return [scene]
    grid = paper_grid((scene.width, scene.height), paper, settings.overlap)
    parts = sheets_of(scene, grid.columns, grid.rows, settings.fine, 0.0, PRINTER_EDGE)
    return [_on_paper(part, k, grid, settings.calibrate) for k, part in enumerate(parts)]


def _on_paper(part: Scene, number: int, grid: PaperGrid, calibrate: bool) -> Scene:
    """Return a part of a page, which has an empty edge, as a sheet of paper with its label."""
    if grid.beside:
        place = np.array([PRINTER_EDGE + part.width + CLEAR, PRINTER_EDGE])
    else:
        place = np.array([PRINTER_EDGE, PRINTER_EDGE + part.height + CLEAR])
    width, height = grid.paper
    sheet = replace(part, width=width, height=height)
    return sheet.with_layers(*_label(number, grid, place, calibrate))


def _label(number: int, grid: PaperGrid, place: np.ndarray, calibrate: bool) -> list[Layer]:
    """Return a sheet's number and the map of the sheets, in which it is dark."""
    row, column = divmod(number, len(grid.columns))
    across, down = grid.columns[-1][1], grid.rows[-1][1]
    scale = MAP / max(across, down)
    cells = [
        rectangle(Box(*(scale * np.array([left, top, right, bottom]) + np.tile(place, 2)).tolist()))
        for top, bottom in _halved(grid.rows)
        for left, right in _halved(grid.columns)
    ]
    words = [f"{number + 1} of {grid.sheets}", f"row {row + 1}", f"column {column + 1}"]
    if grid.beside:
        start, step = np.array([0.0, scale * down + 1.5 * LABEL]), np.array([0.0, 1.5 * LABEL])
    else:
        start, step = np.array([scale * across + LABEL, 0.5 * LABEL]), np.array([7 * LABEL, 0.0])
    lines = tuple(
        Words(text, (float(x), float(y)), LABEL)
        for text, (x, y) in zip(words, (place + start + k * step for k in range(3)), strict=True)
    )
    layers = [
        Layer("this sheet", "mark", Style(BLUE), (cells[number],)),
        Layer("map of the sheets", "mark", Style(None, BLACK, 0.1), tuple(cells)),
        Layer("number", "mark", Style(BLACK), lines),
    ]
    if calibrate:
        layers.append(millimetre_rule(*(place + start + 3 * step).tolist(), upright=grid.beside))
    return layers


def _halved(parts: Spans) -> Spans:
    """Return intervals that meet in the middle of what neighbours share."""
    seams = [(end + start) / 2 for (_, end), (start, _) in pairwise(parts)]
    return list(zip([parts[0][0], *seams], [*seams, parts[-1][1]], strict=True))
