"""Pages of copies in millimetres: which tiles, where, in which colours; and scenes of them."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
