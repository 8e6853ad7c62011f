"""Other worlds: a tile on a sphere, in the hyperbolic plane, around a spiral."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
