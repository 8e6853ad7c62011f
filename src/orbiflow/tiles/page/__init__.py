"""A page in millimetres before it is a file, and the files that it becomes."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
