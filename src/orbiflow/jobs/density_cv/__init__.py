"""Cross-validation of densities of one table: of a `DensityCvRequest`.

Each fit is an item of the same machinery as a batch's files (`orbiflow.jobs.batch`): it is done once,
by whoever is free, and a run that was ended goes on with the fits that are left.
"""

from orbiflow.jobs.density_cv.work import density_cv

__all__ = ["density_cv"]
