"""The formats of files that a scene becomes."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
