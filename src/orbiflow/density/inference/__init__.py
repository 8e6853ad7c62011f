"""Densities of some of a torus' angles: marginal, conditional, and at rows that lack some."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
