"""The folder of a search: a folder for each class, the overview and the page."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
