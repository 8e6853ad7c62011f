"""The folder of a density, as a fit and the jobs on its model leave it."""

from orbiflow.density import written_files

__all__ = ["written_files"]
