"""The same for many files or folds: once each, by whoever is free, resumed where it was interrupted."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
