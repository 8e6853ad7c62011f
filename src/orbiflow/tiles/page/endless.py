"""A tiling without an edge, for formats that show all of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES, Palette
from orbiflow.tiles.page.page import Page, shades
from orbiflow.tiles.page.scene import Motif
from orbiflow.tiles.page.settings import ColourRule
from orbiflow.tiles.tilings import Colouring, Tiling, colouring

DIGITS = 6  # of the coordinates of a polygon, of which so many show


def tiling_json(tiling: Tiling, coloured: Colouring, *, y_down: bool) -> dict[str, Any]:
    """Return what a browser draws a tiling from, as JSON; `tiling.js` reads it.

    - `y_down`: Whether y points down.
    - `group`: The `lattice`, whose columns are its vectors, the `cosets`, each the `linear` part and
      the `translation` of an aspect, and of several figures the number of each aspect's.
    - `colours`: The colouring: `sublattice` (a, b, c), `table` of numbers by aspect and cell, and the
      `shares` of the figures.
    - `polygon`: The outline (N, 2) of the tile; of several figures, `figures` have one each.
    """
    group, aspects = tiling.group, tiling.aspects
    shown: dict[str, Any] = {
        "y_down": y_down,
        "group": {
            "name": group.name,
            "lattice": group.lattice.tolist(),
            "cosets": [
                {"linear": coset.linear.tolist(), "translation": coset.translation.tolist()}
                for coset in (group.cosets[k] for k in aspects.cosets)
            ],
        },
        "colours": {
            "sublattice": list(coloured.sublattice),
            "table": coloured.table.tolist(),
            "shares": list(coloured.shares),
        },
    }
    rings = [polygon_json(prototile.polygon) for prototile in tiling.prototiles]
    if len(rings) == 1:
        return {**shown, "polygon": rings[0]}
    shown["group"]["figures"] = aspects.prototiles.tolist()
    return {**shown, "figures": [{"polygon": ring} for ring in rings]}


def polygon_json(ring: Array) -> list[list[float]]:
    """Return a polygon (N, 2) with as many digits as show."""
    size = float(abs(ring).max()) or 1.0
    return np.round(ring, DIGITS - 1 - int(np.floor(np.log10(size)))).tolist()


@dataclass(frozen=True, eq=False)
class Endless:
    """The whole tiling of which a page shows a part, in its place on the page in mm.

    - `tiling`: The tiling.
    - `palette`: Its colours, as chosen.
    - `colour`: Which tiles have the same colour.
    - `motifs`: What lies on each prototile.
    - `tint`: How much a copy's colour tints what lies on it, from 0 to 1.
    - `line`: The width of the lines around tiles in mm.
    """

    tiling: Tiling
    palette: Palette
    colour: ColourRule
    motifs: tuple[Motif, ...]
    tint: float
    line: float

    @classmethod
    def of_page(
        cls, page: Page, palette: Palette, motifs: tuple[Motif, ...], *, tint: float, line: float
    ) -> Endless:
        """Return the tiling of a page with these colours, motifs and lines."""
        return cls(page.tiling, palette, page.colour, motifs, tint, line)

    def as_json(self) -> dict[str, Any]:
        """Return what `tiling_json` says of it, in its colours."""
        document = tiling_json(self.tiling, colouring(self.tiling), y_down=True)
        if self.colour != "neighbour":
            cosets = self.tiling.aspects.cosets
            numbers = cosets if self.colour == "aspect" else np.zeros_like(cosets)
            table = numbers[:, None, None].tolist()
            document["colours"] = {"sublattice": [1, 0, 1], "table": table, "shares": [1]}
        return document

    def palettes(self) -> dict[str, Palette]:
        """Return all palettes for its figures, the one that was chosen first."""
        colours = colouring(self.tiling)
        others = {name: every for name, every in PALETTES.items() if every != self.palette}
        named = {every: name for name, every in PALETTES.items()}
        chosen = {named.get(self.palette, "as it was"): self.palette, **others}
        if self.colour != "neighbour":
            return chosen
        return {name: shades(every, colours) for name, every in chosen.items()}
