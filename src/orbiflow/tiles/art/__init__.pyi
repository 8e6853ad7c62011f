from .making import Artwork as Artwork
from .making import art_scene as art_scene
from .making import artwork as artwork
from .making import draw_art as draw_art
from .making import render_artwork as render_artwork
from .making import write_artwork as write_artwork
from .settings import ArtSettings as ArtSettings
