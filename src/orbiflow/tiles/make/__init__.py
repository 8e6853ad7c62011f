"""What is made of a page of copies: kinds of cut, exports in real size, artwork, cells that repeat."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
