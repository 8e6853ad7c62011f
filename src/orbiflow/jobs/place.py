"""Where a job's results go, looked at before the work."""

from orbiflow.runtime import check_inputs_kept as keep_inputs
from orbiflow.runtime import check_output_file as check_place
from orbiflow.runtime import check_output_folder as check_folder
from orbiflow.runtime import check_outside_runs as keep_apart

__all__ = ["check_folder", "check_place", "keep_apart", "keep_inputs"]
