from .making import Solid as Solid
from .making import make_solid as make_solid
from .making import write_3mf as write_3mf
from .making import write_stl as write_stl
from .settings import SolidSettings as SolidSettings
