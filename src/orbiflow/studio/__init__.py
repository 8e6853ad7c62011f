"""The studio: tiles and densities made in a browser, by a web server on this very machine."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
