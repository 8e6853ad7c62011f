"""Files that people take away: vector export in millimetres, artwork, and the folder of a search."""

from orbiflow.export.animation import AnimationSettings, animate, animation
from orbiflow.export.art import (
    ArtSettings,
    ArtTile,
    Artwork,
    artwork,
    draw_art,
    read_art_tile,
    read_over,
    render_artwork,
    write_artwork,
)
from orbiflow.export.curves import Curve
from orbiflow.export.density_plot_settings import PlotSettings
from orbiflow.export.density_plots import Plotted, plot_density
from orbiflow.export.dxf_writer import write_dxf
from orbiflow.export.exporting import Exported, export, scenes, write_scene
from orbiflow.export.folder import write_tile_folder
from orbiflow.export.gallery import write_gallery
from orbiflow.export.index_page import index_page
from orbiflow.export.json_writer import write_json
from orbiflow.export.loading import LoadedRun, LoadedTile, load
from orbiflow.export.overview import overview_png
from orbiflow.export.pdf_writer import write_pdf
from orbiflow.export.png_writer import write_png
from orbiflow.export.result_file import ExportTile, read_result
from orbiflow.export.run_folder import write_run
from orbiflow.export.scene import Layer, Scene, Style, Uses
from orbiflow.export.settings import ExportSettings
from orbiflow.export.svg import tile_svg, tiling_svg
from orbiflow.export.svg_writer import write_svg

__all__ = [
    "AnimationSettings",
    "ArtSettings",
    "ArtTile",
    "Artwork",
    "Curve",
    "ExportSettings",
    "ExportTile",
    "Exported",
    "Layer",
    "LoadedRun",
    "LoadedTile",
    "PlotSettings",
    "Plotted",
    "Scene",
    "Style",
    "Uses",
    "animate",
    "animation",
    "artwork",
    "draw_art",
    "export",
    "index_page",
    "load",
    "overview_png",
    "plot_density",
    "read_art_tile",
    "read_over",
    "read_result",
    "render_artwork",
    "scenes",
    "tile_svg",
    "tiling_svg",
    "write_artwork",
    "write_dxf",
    "write_gallery",
    "write_json",
    "write_pdf",
    "write_png",
    "write_run",
    "write_scene",
    "write_svg",
    "write_tile_folder",
]
