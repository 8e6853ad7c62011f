"""The folder of a search: a folder for each class, the overview and the page."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
