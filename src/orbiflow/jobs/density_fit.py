"""The job of a `DensityFitRequest`, as batches and cross-validations ask for it."""

from __future__ import annotations

from typing import Any

from orbiflow.density import DensityEstimator, DensitySettings
from orbiflow.density.operations.fitting import COLUMNS, fit
from orbiflow.density.tables import RowSettings, SpaceSettings
from orbiflow.jobs.density_requests import DensityFitRequest
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Cancel, Finished, progress_events

WIDTH = {"sphere": None, "projective-plane": None, "torus": None, **COLUMNS}
told_of = progress_events


def density_fit(request: DensityFitRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Fit, and write the folder whole; see `orbiflow.density.operations.fitting.fit`."""
    function: Any = fit
    outcome = function.operation.function(
        request.data,
        SpaceSettings(space=request.space, unit=request.unit),
        settings_of(request),
        RowSettings(
            columns=request.columns,
            header=request.header,
            drop_missing=request.drop_missing,
            missing=request.missing,
            weights=request.weights,
        ),
        out=request.out,
        group=request.group,
        picture=request.picture,
        on_event=tell,
        cancel=cancel,
    )
    return Finished("done", outcome.summary)


def settings_of(request: DensityFitRequest) -> DensitySettings:
    """Return the settings of a fit."""
    given: dict[str, Any] = {
        "components": request.parts,
        "max_frequency": request.detail,
        **{name: getattr(request, name) for name in ("segments", "seconds")},
    }
    return DensitySettings(
        **{name: value for name, value in given.items() if value is not None},
        repeats=request.repeats,
        kernels=request.kernels,
        seed=request.seed,
    )


def estimator_of(request: DensityFitRequest, unit: str) -> DensityEstimator:
    """Return what is asked for, before it has seen data; `unit` is that of its angles."""
    missing = "marginalise" if request.missing == "marginalise" else "refuse"
    return DensityEstimator.with_settings(
        request.space, settings_of(request), unit=unit, missing=missing
    )
