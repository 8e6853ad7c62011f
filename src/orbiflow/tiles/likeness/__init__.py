"""How much a tile is like a silhouette: overlap, fidelity, recognisability, and ranking."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
