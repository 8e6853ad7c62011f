"""Solids in millimetres to print: tiles, cookie cutters, stamps, moulds and puzzles, as STL and 3MF."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
