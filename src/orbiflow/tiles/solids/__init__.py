"""Solids in millimetres to print: tiles, cookie cutters, stamps, moulds and puzzles, as STL and 3MF."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
