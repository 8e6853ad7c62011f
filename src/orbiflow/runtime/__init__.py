"""Running work: operations, events, cancelling, worker processes, and files that are written whole."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
