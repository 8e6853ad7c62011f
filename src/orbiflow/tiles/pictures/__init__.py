"""Pictures of tiles: tilings, overlays, the nine classes, a choice between two aims."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
