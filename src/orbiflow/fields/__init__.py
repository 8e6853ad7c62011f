"""Vector fields with symmetry: Fourier fields, and the symmetrization of any field."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
