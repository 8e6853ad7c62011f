"""Animations of tilings: morphs, bending and growing, as SVG, GIF and MP4."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
