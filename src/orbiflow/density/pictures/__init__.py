"""Pictures of densities: on squares, on maps, and on surfaces to turn."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
