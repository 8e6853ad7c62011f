from .app import create_app as create_app
from .project_file import StudioProject as StudioProject
from .project_file import open_project as open_project
from .settings import Limits as Limits
from .settings import StudioSettings as StudioSettings
from .store import Store as Store
from .work_queue import WorkQueue as WorkQueue
