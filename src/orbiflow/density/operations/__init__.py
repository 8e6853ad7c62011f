"""The operations on densities: light modules, which import what they need when they run."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
