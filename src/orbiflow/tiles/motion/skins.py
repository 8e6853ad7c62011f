"""What lies on the tiles of an animation: painted once, and bent with the body of each frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from orbiflow.arrays import Array, Integers
from orbiflow.drawing import Palette
from orbiflow.tiles.motifs import Over, motifs_on, read_overs, require_figures, with_map
from orbiflow.tiles.motion.settings import AnimationSettings
from orbiflow.tiles.page import Motif, Pixels, Warped, glass, tinted
from orbiflow.tiles.silhouette import triangulate
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.write import texture

TEXELS_PER_PIXEL = 2.0
"""Pixels of what lies on a tile along one of a frame."""


class BendingFigure(NamedTuple):
    """What of a figure bends: points (V, 2) of the tile, in its figure's units, and triangles."""

    points: Array
    triangles: Integers

    @classmethod
    def of(cls, figure: EscherTile) -> BendingFigure:
        """Return the body of a silhouette that bends, or else of the tile as it is."""
        if figure.bending is not None and figure.frame is not None:
            return cls(figure.frame.to_input(figure.bending.images), figure.bending.triangles)
        mesh = triangulate(figure.tile.polygon)
        return cls(mesh.points, mesh.triangles)


class Skin(NamedTuple):
    """What lies on a figure, in each colour that its copies have, and where its body lies in it."""

    pixels: tuple[Pixels, ...]
    texels: Array
    triangles: Integers

    def on(self, body: Array, colour: int, within: str) -> Motif:
        """Return it on its body's points (V, 2) as they are in a frame, cut off by a symbol."""
        bent = Warped(self.pixels[colour], self.texels, body, self.triangles)
        return Motif(rasters=(bent,), within=within)


@dataclass(frozen=True, eq=False)
class Dress:
    """Skins of a tile's figures; `bodies` are in their units."""

    bodies: tuple[BendingFigure, ...]
    skins: tuple[Skin, ...]

    @classmethod
    def of(
        cls,
        tile: EscherTile,
        settings: AnimationSettings,
        overs: Sequence[Over],
        scale: float,
        shaded: Palette,
        count: int,
    ) -> Dress:
        """Paint all that lies on a tile, at `scale` pixels along its unit, in so many colours."""
        density = TEXELS_PER_PIXEL * scale
        on = motifs_on(tile, settings, shaded, overs, tint=settings.tint, density=density)
        bodies, skins = list[BendingFigure](), list[Skin]()
        for motif, part in zip(on.motifs, tile.figures, strict=True):
            body, ring = BendingFigure.of(part.figure), part.figure.tile.polygon
            fine = density * part.place.scale
            painted = [
                texture(
                    tinted(motif, glass(shaded.fill(k), on.tint)), ring, fine, ink=shaded.ink(k)
                )
                for k in range(count)
            ]
            texels = (body.points - painted[0].offset) / painted[0].linear[0, 0]
            skins.append(Skin(tuple(picture.pixels for picture in painted), texels, body.triangles))
            bodies.append(body)
        return cls(tuple(bodies), tuple(skins))


def dressed(
    tile: EscherTile, settings: AnimationSettings, pictures: Sequence[Path | None]
) -> tuple[EscherTile, list[Over]]:
    """Return a tile with the map that carries what lies on it, and what lies on each of its figures.

    Raises:
        OrbiflowError: If a picture cannot be read or carried, or is for a figure that is not there.
    """
    if not (settings.draws or any(pictures)):
        return tile, []
    tile = with_map(tile)
    require_figures(tile, settings, 1 + any(pictures[1:]))
    return tile, read_overs(pictures, tile)
