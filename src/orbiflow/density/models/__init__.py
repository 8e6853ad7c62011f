"""Models of densities: push-forwards of a base, kernels, chains, networks and their mixtures."""

from orbiflow.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
