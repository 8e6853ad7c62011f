"""Artwork: pictures and drawings of a silhouette carried onto its tile and repeated over the plane."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
