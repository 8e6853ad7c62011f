"""How much a tile is like a silhouette: overlap, fidelity, recognisability, and ranking."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
