from .files import write_3mf as write_3mf
from .files import write_stl as write_stl
from .making import Solid as Solid
from .making import make_solid as make_solid
from .settings import SolidSettings as SolidSettings
