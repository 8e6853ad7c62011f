"""Artwork: pictures and drawings of a silhouette carried onto its tile, and repeated over the plane."""

from orbiflow.export.art.art_scene import art_scene
from orbiflow.export.art.making import Artwork, artwork, render_artwork
from orbiflow.export.art.over import Over, read_over
from orbiflow.export.art.settings import ArtSettings
from orbiflow.export.art.source import ArtTile, read_art_tile
from orbiflow.export.art.writing import draw_art, write_artwork

__all__ = [
    "ArtSettings",
    "ArtTile",
    "Artwork",
    "Over",
    "art_scene",
    "artwork",
    "draw_art",
    "read_art_tile",
    "read_over",
    "render_artwork",
    "write_artwork",
]
