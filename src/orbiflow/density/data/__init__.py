"""Data as people have them: arrays and frames of any library, names of columns, units of values."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
