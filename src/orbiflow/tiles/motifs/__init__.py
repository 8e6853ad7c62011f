"""What lies on a tile: a carried picture or drawing, engraved lines, eyes; as curves or as pixels."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
