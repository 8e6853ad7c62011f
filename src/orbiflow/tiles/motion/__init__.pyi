from .animations import animate as animate
from .animations import animation as animation
from .settings import AnimationSettings as AnimationSettings
