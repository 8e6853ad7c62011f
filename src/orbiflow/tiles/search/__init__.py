"""The search for tiles: placements, co-deformation, the descent, the occupancy method."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
