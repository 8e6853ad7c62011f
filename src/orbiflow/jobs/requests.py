"""All that can be asked for, by its kind.

Importing this takes no time: no numerical library.
"""

from __future__ import annotations

from orbiflow.jobs.batch_requests import BatchRequest, DensityBatchRequest
from orbiflow.jobs.density_compare_requests import DensityCompareRequest, DensityRegionRequest
from orbiflow.jobs.density_cv_requests import DensityCvRequest, DensityFoldRequest
from orbiflow.jobs.density_requests import (
    DensityFitRequest,
    DensityPlotRequest,
    PatchesRequest,
)
from orbiflow.jobs.request import SCHEMA_VERSION, Request
from orbiflow.jobs.tile_requests import EscherizeRequest
from orbiflow.runtime import RecordError, is_object, kind_of

REQUESTS: dict[str, type[Request]] = {
    kind.KIND: kind
    for kind in (
        EscherizeRequest,
        DensityFitRequest,
        DensityPlotRequest,
        DensityCompareRequest,
        DensityRegionRequest,
        PatchesRequest,
        BatchRequest,
        DensityBatchRequest,
        DensityCvRequest,
        DensityFoldRequest,
    )
}


def request_from_json(document: object) -> Request:
    """A request from what its `to_json` gave, or from anybody: every field is checked.

    Raises:
        RecordError: for another version or kind, and for fields that are unknown, missing, of
            another type or out of range, by their names.

    >>> document = {"schema_version": 1, "kind": "escherize", "image": "cat.png", "workers": 2}
    >>> request_from_json(document) == EscherizeRequest(image="cat.png", workers=2)
    True
    """
    kind = kind_of(document, REQUESTS, "request")
    assert issubclass(kind, Request)
    assert is_object(document)
    version = document.get("schema_version")
    if version != SCHEMA_VERSION:
        raise RecordError(f"a request has schema_version {SCHEMA_VERSION}, got {version!r}")
    own = {name: v for name, v in document.items() if name not in ("kind", "schema_version")}
    return kind.of_fields(own)
