"""Fitting densities: the closed-form start, likelihood, kernels, and the report of a fit."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
