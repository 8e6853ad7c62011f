from .overview import overview_png as overview_png
from .page import index_page as index_page
from .run_folder import result_folder as result_folder
from .run_folder import write_gallery as write_gallery
from .run_folder import write_run as write_run
from .run_folder import write_tile_folder as write_tile_folder
from .run_folder import written_files as written_files
