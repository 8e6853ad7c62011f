"""What can be asked for of many files at once: one frozen dataclass a kind, checked when made."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path, PurePath
from typing import Any, ClassVar

from orbiflow.jobs.density_requests import DensityFitRequest
from orbiflow.jobs.request import Request, at_least_one
from orbiflow.jobs.tile_requests import EscherizeRequest
from orbiflow.runtime import RecordError, field_names

DRAWN = (".svg", ".json", ".geojson", ".dat")
"""Endings of silhouettes that are no pictures: how these are read does not concern them."""


@dataclass(frozen=True)
class ManyRequest(Request):
    """The same for every file of a folder; base of the requests of batches.

    - `folder`: is searched with the folders in it; names that begin with a dot are left out.
    - `out`: folder for the results; an earlier batch there is gone on with.
    - `each`: fields of the request that is made for each file, as in its JSON.
    - `match`: a pattern of names, such as "*.svg"; None for all that can be read.
    - `workers`: processes, None for one a core. `scheduler`: address of a Dask scheduler instead.
    - `retry_failed`: do again what failed in an earlier batch.
    """

    KIND = "many"
    OWN: ClassVar[tuple[str, ...]] = ()
    """Fields of the request of each file that the batch gives, or that have no sense in one."""

    folder: Path
    out: Path = Path("batch")
    each: dict[str, Any] = field(default_factory=dict[str, Any])
    match: str | None = None
    workers: int | None = None
    scheduler: str | None = None
    retry_failed: bool = False

    def check(self) -> None:
        check_workers(self)
        if self.match is not None and not self.match.strip():
            raise RecordError("{match} must be a pattern of names, such as *.svg")
        for name in self.OWN:
            if name in self.each:
                raise RecordError(f"{{each}} cannot have the field {name!r} in a batch")
        self.one("any")

    def one(self, name: str) -> Request:
        """The request of the file of a name.

        Raises:
            RecordError: for a field that cannot be used, by its name.
        """
        raise NotImplementedError


@dataclass(frozen=True)
class BatchRequest(ManyRequest):
    """Find tiles for every silhouette of a folder; see `orbiflow batch --help`.

    `each`: fields of an `EscherizeRequest`; no masks and pins, which belong to one silhouette.

    >>> BatchRequest(folder="animals", each={"effort": "fast"}).one("cat.png").effort
    'fast'
    """

    KIND = "batch"
    OWN = (
        "image",
        "out",
        "workers",
        "called",
        "emphasis",
        "strength",
        "pin",
        "pin_angle",
    )

    def one(self, name: str) -> EscherizeRequest:
        # one process does one silhouette: many at a time are the better use of cores
        given = {"image": name, "workers": 1, "called": name}
        drawn = PurePath(name).suffix.lower() in DRAWN
        each = {k: v for k, v in self.each.items() if not (drawn and k in ("threshold", "invert"))}
        return EscherizeRequest.of_fields({**each, **given})


@dataclass(frozen=True)
class DensityBatchRequest(ManyRequest):
    """Fit a density to every table of a folder; see `orbiflow density batch --help`.

    `each`: fields of a `DensityFitRequest`.
    """

    KIND = "density-batch"
    OWN = ("data", "out")

    def one(self, name: str) -> DensityFitRequest:
        return DensityFitRequest.of_fields({"picture": True, **self.each, "data": name})


def check_workers(request: Request) -> None:
    """Raises a `RecordError` unless its `workers` or its `scheduler` can be had."""
    at_least_one(request, "workers")
    scheduler = getattr(request, "scheduler", None)
    if getattr(request, "workers", None) is not None and scheduler is not None:
        raise RecordError(
            "{workers} are processes of this machine, those of a {scheduler} are its own: give one"
        )
    if scheduler == "":
        raise RecordError("{scheduler} must be an address, such as tcp://10.0.0.5:8786")


def settings_of(request: Request, without: tuple[str, ...]) -> dict[str, Any]:
    """Its fields as JSON has them, but for some: what decides the result besides the file."""
    document = request.to_json()
    return {name: document[name] for name in field_names(request) if name not in without}
