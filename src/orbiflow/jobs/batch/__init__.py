"""One job for every file of a folder: of a `BatchRequest` and a `DensityBatchRequest`.

What is done is done for good: a batch that was ended, in whatever way, is gone on with by asking for it
again, and only what is missing, changed or new is worked on.
"""

from orbiflow.jobs.batch.files import batch, density_batch

__all__ = ["batch", "density_batch"]
