"""Models of densities: push-forwards of a base, kernels, chains, networks and their mixtures."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
