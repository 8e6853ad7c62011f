"""Densities on the torus, the sphere, the Klein bottle and the projective plane."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
