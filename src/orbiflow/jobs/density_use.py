"""Scores and samples: the jobs that write one table."""

from __future__ import annotations

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density import (
    DensityLevels,
    append_columns,
    chart_of_observed,
    log_prob_observed,
    mean_of,
    resolvable_masses,
    scores_of,
    to_csv,
    weighed,
)
from orbiflow.jobs.asked import samples_asked
from orbiflow.jobs.density_data import (
    read_weighed,
    same_columns,
)
from orbiflow.jobs.density_models import check_fits, model_at
from orbiflow.jobs.density_requests import (
    DensitySampleRequest,
    DensityScoreRequest,
)
from orbiflow.jobs.density_scores import evaluated
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Progress,
    Written,
    one_thread,
    write_atomic,
)

PATCH_WIDTHS = (8, 9)
"""Columns of image patches."""


@one_thread()
def density_score(request: DensityScoreRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Add log densities to a table.

    Returns:
        `summary`: `file`, `rows`, and the `mean` log density in nats, weighted, of the rows that lack
        nothing.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_place(request.out, request.data, request.model)
    density, extra = model_at(request.model)
    columns = request.columns or same_columns(request.data, extra, tell, has_header=request.header)
    keep = request.missing == "marginalise"
    table, weights = read_weighed(
        request.data,
        columns,
        None,
        request.weights,
        tell,
        has_header=request.header,
        drop_missing=request.drop_missing or request.missing == "drop",
        keep_missing=keep,
    )
    space = density.space
    check_fits(request.data, table, space, extra, tell)
    points = chart_of_observed(space, table.values) if keep else space.to_chart(table.values)
    known = ~points.isnan()
    lacking = int((~known.all(dim=1)).sum())
    log_prob = log_prob_observed if lacking else type(density).log_prob
    added = evaluated(density, table, points, log_prob, request, tell, cancel)
    name = "log_prob_marginal" if lacking else "log_prob"
    scores = added.pop("log_prob")
    added = {name: scores, **added}
    if request.region:
        samples = samples_asked(request)
        tell(Progress(1.0, f"drawing {samples} samples"))
        natural = scores_of(density, table.values) if request.measure != "natural" else scores
        added["hdr"] = DensityLevels(density, samples=samples).hdr_of(natural)
        tell(Note(_said_of_regions(samples)))
    write_atomic(request.out, append_columns(table, request.data, added))
    tell(Written(request.out))
    if lacking:
        tell(Note(_said_of_missing(known, name)))
    mean = _mean(scores, weights, known.all(dim=1).numpy())
    over = f"{len(scores)} rows" if not lacking else f"the {len(scores) - lacking} whole rows"
    weighted = "" if weights is None else f", weighted by {request.weights}"
    tell(Note(f"mean log density {mean:.4f} nats over {over}{weighted}; written to {request.out}"))
    return Finished("done", {"file": str(request.out), "rows": len(scores), "mean": mean})


def _said_of_regions(samples: int) -> str:
    """How far `hdr` can be trusted."""
    low, high = resolvable_masses(samples)
    return (
        "hdr: the mass of the smallest highest-density region that holds the row, by "
        f"{samples} samples (--samples): ± {0.5 / math.sqrt(samples):.2g} at most; what is below "
        f"{low:g} or above {high:.10g} they do not tell apart"
    )


def _said_of_missing(known: Tensor, name: str) -> str:
    """In words, of rows and which of their angles are known."""
    lacking, empty = int((~known.all(dim=1)).sum()), int((~known.any(dim=1)).sum())
    nothing = f"; {empty} of them have none, hence 0" if empty else ""
    return (
        f"{lacking} of {len(known)} rows lack some angles: {name} is the log density of those "
        f"that they have{nothing}"
    )


def _mean(scores: Array, weights: Array | None, whole: NDArray[np.bool_]) -> float:
    """Of the whole rows: densities of fewer angles are in another unit."""
    chosen = whole if whole.any() else np.ones_like(whole)
    rows = weighed(torch.tensor(scores[chosen, None]), None if weights is None else weights[chosen])
    return mean_of(rows.points[:, 0], rows.weights)


@one_thread()
def density_sample(request: DensitySampleRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Draw samples.

    Returns:
        `summary`: `file` and `rows`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_place(request.out, request.model)
    density, extra = model_at(request.model)
    generator = torch.Generator().manual_seed(request.seed)
    data = density.space.from_chart(density.sample((request.count,), generator))
    names = extra.get("columns", [])
    if len(names) != data.shape[1]:
        names = density.space.columns
    cancel.check()
    write_atomic(request.out, to_csv(names, data))
    tell(Written(request.out))
    tell(Note(f"{request.count} samples written to {request.out}"))
    return Finished("done", {"file": str(request.out), "rows": request.count})
