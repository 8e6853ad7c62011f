"""What lies on a tile: a carried picture or drawing, engraved lines, eyes; as curves or as pixels."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
