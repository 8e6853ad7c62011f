"""Fitting densities: the closed-form start, likelihood, kernels, and the report of a fit."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
