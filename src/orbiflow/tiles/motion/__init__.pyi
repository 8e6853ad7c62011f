from .morph import Morph as Morph
from .own_frame import OwnFrame as OwnFrame
from .settings import AnimationSettings as AnimationSettings
from .skins import dressed as dressed
from .writers import animation as animation
from .writers import still as still
