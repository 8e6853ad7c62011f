from .making import Solid as Solid
from .making import make_solid as make_solid
from .making import solid_file as solid_file
from .making import write_3mf as write_3mf
from .making import write_stl as write_stl
from .picture import read_solid as read_solid
from .picture import solid_picture as solid_picture
from .settings import SolidSettings as SolidSettings
