"""The silhouette that a tile should look like: readers, its frame, its mesh, what matters in it."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
