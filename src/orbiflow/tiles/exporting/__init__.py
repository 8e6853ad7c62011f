"""Vector files in millimetres: scenes, cuts, nesting, sheets, and a writer for each format."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
