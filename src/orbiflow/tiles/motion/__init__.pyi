from .settings import AnimationSettings as AnimationSettings
from .writers import animate as animate
from .writers import animation as animation
