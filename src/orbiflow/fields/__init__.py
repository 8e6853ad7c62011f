"""Vector fields with symmetry: Fourier fields, and the symmetrization of any field."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
