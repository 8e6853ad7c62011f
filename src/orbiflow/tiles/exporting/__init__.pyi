from .layouts import longer_side as longer_side
from .settings import ExportSettings as ExportSettings
from .writing import Exported as Exported
from .writing import export as export
from .writing import scenes as scenes
from .writing import write_scene as write_scene
