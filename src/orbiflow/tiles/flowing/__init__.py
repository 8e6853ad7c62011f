"""Searches that move tiles by flows, and tiles by a loss of one's own: all that needs torch."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
