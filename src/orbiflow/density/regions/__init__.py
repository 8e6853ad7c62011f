"""Regions of highest density and level sets, with their mass and their outlines."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
