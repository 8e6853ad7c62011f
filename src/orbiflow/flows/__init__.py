"""Integrators and flows: diffeomorphisms from vector fields."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
