"""Diffeomorphisms that commute with a crystallographic group.

The names here are public: documented on one page (docs/reference/names.md) and stable. All others
are internal and may change. Importing this package alone loads no numerical library: a name is looked
up when it is first used.

>>> import orbiflow
>>> orbiflow.isohedral_class("IH4").group_name
'p2'
"""

from orbiflow.settings import door

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = door(__name__, __file__)
