"""Escherization: from a silhouette to certified tiles, and from tiles to files for people."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
