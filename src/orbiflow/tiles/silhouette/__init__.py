"""The silhouette that a tile should look like: readers, its frame, its mesh, what matters in it."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
