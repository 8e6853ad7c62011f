"""Comparisons of fitted densities and of data sets, with their uncertainty."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
