"""Integrators and flows: diffeomorphisms from vector fields."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
