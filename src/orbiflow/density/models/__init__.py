"""Models of densities: push-forwards of a base, kernels, chains, networks and their mixtures."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
