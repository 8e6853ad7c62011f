from .making import Solid as Solid
from .making import make_solid as make_solid
from .making import solid_files as solid_files
from .settings import BALLS as BALLS
from .settings import SolidSettings as SolidSettings
