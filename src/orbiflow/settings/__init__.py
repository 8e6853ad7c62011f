"""Settings of operations: declared once, read from words, JSON and Python alike, and checked."""

from orbiflow.settings.extras import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
