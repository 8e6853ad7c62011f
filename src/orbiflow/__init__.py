"""Diffeomorphisms that commute with a crystallographic group.

What most people want is named here; each room names the rest of its own. Importing this package alone
loads no numerical library: a name is looked up when it is first used.

>>> import orbiflow
>>> orbiflow.isohedral_class("IH4").group_name
'p2'
"""

from orbiflow.extras import door

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = door(__name__, __file__)
