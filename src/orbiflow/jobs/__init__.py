"""Jobs: what the commands, a batch and a web page call alike.

A request says what is to be done, `run` does it in this process and `start` in one of its own; both
tell the same events. Importing this is quick: numerical libraries come with the work.

>>> request = EscherizeRequest(image="cat.png", out="cat", classes=("IH4", "IH6"))
>>> request_from_json(request.to_json()) == request
True
"""

from orbiflow.jobs.batch_requests import BatchRequest, DensityBatchRequest
from orbiflow.jobs.density_compare_requests import DensityCompareRequest, DensityRegionRequest
from orbiflow.jobs.density_cv_requests import DensityCvRequest, DensityFoldRequest
from orbiflow.jobs.density_requests import (
    DensityFitRequest,
    DensityPlotRequest,
    PatchesRequest,
)
from orbiflow.jobs.process import Job, start
from orbiflow.jobs.request import Request
from orbiflow.jobs.requests import request_from_json
from orbiflow.jobs.run import Sink, run
from orbiflow.jobs.tile_requests import EscherizeRequest
from orbiflow.runtime import (
    Cancel,
    ClassFailed,
    Event,
    Failed,
    Finished,
    ItemDone,
    Note,
    Preview,
    Progress,
    RecordError,
    Started,
    TileFound,
    Written,
    event_from_json,
)

__all__ = [
    "BatchRequest",
    "Cancel",
    "ClassFailed",
    "DensityBatchRequest",
    "DensityCompareRequest",
    "DensityCvRequest",
    "DensityFitRequest",
    "DensityFoldRequest",
    "DensityPlotRequest",
    "DensityRegionRequest",
    "EscherizeRequest",
    "Event",
    "Failed",
    "Finished",
    "ItemDone",
    "Job",
    "Note",
    "PatchesRequest",
    "Preview",
    "Progress",
    "RecordError",
    "Request",
    "Sink",
    "Started",
    "TileFound",
    "Written",
    "event_from_json",
    "request_from_json",
    "run",
    "start",
]
