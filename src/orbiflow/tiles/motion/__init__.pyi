from .animations import AnimationSettings as AnimationSettings
from .animations import animate as animate
from .animations import animation as animation
