"""Densities of some of a torus' angles: marginal, conditional, and at rows that lack some."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
