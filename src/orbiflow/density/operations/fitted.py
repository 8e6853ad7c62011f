"""What a fit reports: which settings, how well it describes the rows, and what it did."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.tables import TableRows

MOST_SCORED = 20_000
"""Rows over which the mean log density is taken: up to here all of them, for a few hundredths of the
fit's time at most; of 100,000 rows of six angles it would be two fifths."""

REPORTED = (
    "components", "repeats", "missing", "weights", "group", "max_frequency", "segments", "kernels",
    "seed",
)  # fmt: skip
"""Settings that the report repeats."""


def is_whole(rows: TableRows) -> NDArray[np.bool_]:
    """Return which rows (N,) lack no value."""
    return np.logical_and.reduce(np.isfinite(rows.table.values), axis=1)


def fit_document(
    estimator: DensityEstimator, rows: TableRows, asked: Mapping[str, Any], seed: int
) -> dict[str, Any]:
    """Return what report.json says of a fit."""
    report, space = estimator.report_, estimator.space_
    scored = _scored(rows, seed)
    weights = None if rows.weights is None else rows.weights[scored]
    return {
        "space": {"name": space.name, **space.settings()},
        "columns": rows.table.columns,
        "settings": {name: asked[name] for name in REPORTED},
        "log_likelihood": {
            "natural": estimator.score(rows.table.values[scored], sample_weight=weights),
            "natural_rows": len(scored),
            "uniform": -math.log(space.volume),
            "square_train": -report.train_nll,
            "square_validation": -report.validation_nll,
        },
        "report": report.to_json(),
    }


def fit_words(document: Mapping[str, Any], rows: int, out: Path) -> tuple[str, str]:
    """Return what came of a fit to so many rows, in words."""
    likelihood, mass = document["log_likelihood"], document["report"]["mass"]
    gain = likelihood["natural"] - likelihood["uniform"]
    scored = likelihood["natural_rows"]
    which = "these rows" if scored == rows else f"{scored} of them"
    return (
        f"{rows} rows: mean log density at {which} {likelihood['natural']:.4f} nats, {gain:.4f} more "
        f"than the uniform density; integral {'not checked' if mass is None else f'{mass:.5f}'}",
        f"written to {out} in {document['seconds']:.0f} s",
    )


def _scored(rows: TableRows, seed: int) -> NDArray[np.int64]:
    """Which rows the mean log density is of: those that count and lack nothing, or many of them."""
    whole = is_whole(rows)
    if rows.weights is not None:
        whole &= rows.weights > 0
    found = np.flatnonzero(whole)
    if len(found) <= MOST_SCORED:
        return found
    return np.sort(np.random.default_rng(seed).choice(found, MOST_SCORED, replace=False))
