"""Other worlds: a tile on a sphere, in the hyperbolic plane, around a spiral."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
