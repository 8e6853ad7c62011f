"""Solids whose copies under a space group fill space, made to look like any mesh."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
