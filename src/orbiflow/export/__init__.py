"""Files that people take away: artwork in SVG, and the folder of a search."""

from orbiflow.export.folder import write_tile_folder
from orbiflow.export.gallery import overview_png, write_gallery
from orbiflow.export.svg import tile_svg, tiling_svg

__all__ = ["overview_png", "tile_svg", "tiling_svg", "write_gallery", "write_tile_folder"]
