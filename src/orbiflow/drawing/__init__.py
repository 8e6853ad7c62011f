"""What pictures of tiles and of densities share: sheets, palettes, rasters, marks of symmetry."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
