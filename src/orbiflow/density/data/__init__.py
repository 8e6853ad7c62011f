"""Data as people have them: arrays and frames of any library, names of columns, units of values."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
