"""What pictures of tiles and of densities share: sheets, palettes, rasters, marks of symmetry."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
