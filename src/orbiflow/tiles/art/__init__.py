"""Artwork: pictures and drawings of a silhouette carried onto its tile and repeated over the plane."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
