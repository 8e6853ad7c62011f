from .app import create_app as create_app
from .settings import Limits as Limits
from .settings import StudioSettings as StudioSettings
from .store import Store as Store
from .work_queue import WorkQueue as WorkQueue
