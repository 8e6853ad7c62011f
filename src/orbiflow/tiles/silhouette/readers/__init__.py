"""Readers of silhouettes: pictures, drawings, polygons and masks."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
