"""Pictures of densities: on squares, on maps, and on surfaces to turn."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
