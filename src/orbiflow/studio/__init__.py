"""The studio: tiles and densities made in a browser, by a web server on this very machine."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
