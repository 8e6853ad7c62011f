"""Log densities, gradients and masses of the rows of a table, as columns to add to it."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.comparing import scores_of
from orbiflow.density.fitting import Progress, mean_of, weighed
from orbiflow.density.inference import at_observed, chart_of_observed
from orbiflow.density.models import CHECKED, Density, TabulatedDensity, log_density_gradient
from orbiflow.density.regions import DensityLevels, resolvable_masses, samples_for
from orbiflow.density.tables import TableRows

if TYPE_CHECKING:
    from orbiflow.density.operations.queries import ScoreSettings

BLOCK, BLOCK_GRADIENT = 2**18, 2**16
"""Rows at a time: many cost less each, few leave room and tell how far it is."""

SCORED = 0.3
"""Share of the work that is done when gradients are still to be found."""


def score_rows(
    density: Density,
    rows: TableRows,
    settings: ScoreSettings,
    progress: Progress,
    *,
    may_lack: bool = False,
) -> tuple[dict[str, Array], float, str, list[str]]:
    """Return columns (N,) to add to the table, log densities first, and what is known of them.

    These are the weighted mean log density, in nats, of the rows that lack nothing, which rows they are
    in words, and notes.
    """
    space, values = density.space, rows.table.values
    points = chart_of_observed(space, values) if may_lack else space.to_chart(values)
    known = ~points.isnan()
    whole = known.all(dim=1).numpy()
    name = "log_prob" if whole.all() else "log_prob_marginal"
    notes: list[str] = []
    columns = {name: _log_densities(density, points, settings, progress, notes)}
    if settings.gradient:
        columns |= _gradients(density, rows, progress)
    if settings.region:
        count = samples_for((), settings.samples)
        progress(1.0, f"drawing {count} samples")
        natural = settings.measure == "natural"
        scores = columns[name] if natural else scores_of(density, values)
        columns["hdr"] = DensityLevels(density, samples=count).hdr_of(scores)
        notes.append(_region_note(count))
    if not whole.all():
        notes.append(_missing_note(known, name))
    over = f"{len(whole)} rows" if whole.all() else f"the {whole.sum()} whole rows"
    return columns, mean_of_whole(columns[name], rows.weights, whole), over, notes


def _log_densities(
    density: Density, points: Tensor, settings: ScoreSettings, progress: Progress, notes: list[str]
) -> NDArray[np.float64]:
    if settings.table:
        progress(0.0, "making a table")
        source = TabulatedDensity(density)
        notes.append(
            f"read off a table: the error is {source.error:.1e} nats at the density's own points, "
            f"{source.largest:.1e} at most among {CHECKED} of them and as many anywhere"
        )
        log_prob: Callable[..., Tensor] = source.log_prob
    else:
        log_prob = partial(at_observed, density)
    found: list[NDArray[np.float64]] = []
    end = SCORED if settings.gradient else 1.0
    for start in range(0, len(points), BLOCK):
        with torch.no_grad():
            scores = log_prob(points[start : start + BLOCK], measure=settings.measure)
        found.append(scores.double().numpy())
        progress(end * min(1.0, (start + BLOCK) / len(points)), "scoring")
    return np.concatenate(found)


def _gradients(density: Density, rows: TableRows, progress: Progress) -> dict[str, Array]:
    """Return the gradient of the log density, a column (N,) for each of the data's coordinates."""
    values = rows.table.values
    found: list[NDArray[np.float64]] = []
    for start in range(0, len(values), BLOCK_GRADIENT):
        found.append(log_density_gradient(density, values[start : start + BLOCK_GRADIENT])[1])
        share = min(1.0, (start + BLOCK_GRADIENT) / len(values))
        progress(SCORED + (1 - SCORED) * share, "finding gradients")
    names = [f"log_prob_by_{name}" for name in rows.table.columns]
    return dict(zip(names, np.concatenate(found).T, strict=True))


def mean_of_whole(scores: Array, weights: Array | None, whole: NDArray[np.bool_]) -> float:
    """Return the mean of the rows that lack nothing: densities of fewer angles are in another unit."""
    chosen = whole if whole.any() else np.ones_like(whole)
    rows = weighed(torch.tensor(scores[chosen, None]), None if weights is None else weights[chosen])
    return mean_of(rows.points[:, 0], rows.weights)


def _region_note(samples: int) -> str:
    """Return how far `hdr` can be trusted, in words."""
    low, high = resolvable_masses(samples)
    return (
        "hdr: the mass of the smallest highest-density region that holds the row, by "
        f"{samples} samples (--samples): ± {0.5 / math.sqrt(samples):.2g} at most; what is below "
        f"{low:g} or above {high:.10g} they do not tell apart"
    )


def _missing_note(known: Tensor, name: str) -> str:
    """Return in words how many rows lack angles, and what their log density is."""
    lacking, empty = int((~known.all(dim=1)).sum()), int((~known.any(dim=1)).sum())
    nothing = f"; {empty} of them have none, hence 0" if empty else ""
    return (
        f"{lacking} of {len(known)} rows lack some angles: {name} is the log density of those "
        f"that they have{nothing}"
    )
