"""What all figures of a tile carry, read and drawn once, whatever page or frame shows it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import zip_longest
from typing import NamedTuple

from orbiflow.drawing import Palette
from orbiflow.tiles.motifs.carried import Over, carried_picture, drawn_motif
from orbiflow.tiles.motifs.settings import MotifSettings
from orbiflow.tiles.page import Motif
from orbiflow.tiles.tile import EscherTile


class FigureMotifs(NamedTuple):
    """What lies on the figures of a tile.

    - `motifs`: On each, in its units: a picture of pixels, and what is drawn over it.
    - `tint`: How much each copy's colour tints all that; 0 where nothing from a file lies there.
    - `notes`: What the user should know of it.
    """

    motifs: tuple[Motif, ...]
    tint: float
    notes: tuple[str, ...]

    @property
    def has_pictures(self) -> bool:
        """Whether there are pictures of pixels."""
        return any(motif.rasters for motif in self.motifs)


def motifs_on(
    tile: EscherTile,
    settings: MotifSettings,
    palette: Palette,
    overs: Sequence[Over | None],
    *,
    tint: float,
    density: float,
    hairlines: bool = False,
) -> FigureMotifs:
    """Return what lies on a tile with a map.

    Args:
        tile: The tile.
        settings: What is drawn on it.
        palette: Its colours.
        overs: What lies over the silhouette of each figure, as `read_over` returns it.
        tint: How much each copy's colour tints what is from a file.
        density: The pixels of pictures along a unit of the tile.
        hairlines: Whether engraved lines are hairlines along their middle, for a machine to follow.

    Raises:
        OrbiflowError: If a picture or an eye is given but there is no map of the silhouette, or an eye
            lies outside it.
    """
    figures = [part.figure for part in tile.figures]
    all_overs = [over or Over() for over, _ in zip_longest(overs, figures)]
    motifs = list[Motif]()
    for number, (over, part) in enumerate(zip(all_overs, tile.figures, strict=True)):
        motif_settings, rasters = settings.of_figure(number), ()
        drawn = drawn_motif(part.figure, motif_settings, palette, over.drawing, hairlines=hairlines)
        if over.picture is not None:
            rasters = (carried_picture(over.picture, part.figure, density * part.place.scale),)
        motifs.append(Motif(drawn.parts, rasters))
    return FigureMotifs(
        tuple(motifs),
        tint * any(over.picture or over.drawing for over in all_overs),
        tuple(note for source in (*figures, *all_overs) for note in source.notes),
    )
