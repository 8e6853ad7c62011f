from .settings import AnimationSettings as AnimationSettings
from .writers import animation as animation
from .writers import still as still
