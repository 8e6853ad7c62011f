"""The search for tiles: what all methods share, and the search for likeness."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
