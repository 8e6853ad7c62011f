"""Scores, samples and patches: the jobs that write one table."""

from __future__ import annotations

import numpy as np
import torch

from orbiflow.cancel import Cancel
from orbiflow.density.spaces.patches import to_klein
from orbiflow.density.tables import append_column, to_csv
from orbiflow.errors import OrbiflowError
from orbiflow.files import write_atomic
from orbiflow.jobs.density_data import model_at, read_data, same_columns
from orbiflow.jobs.density_requests import DensitySampleRequest, DensityScoreRequest, PatchesRequest
from orbiflow.jobs.events import Finished, Note, Progress, Written
from orbiflow.jobs.run import Sink
from orbiflow.threads import one_thread

BLOCK = 65_536


@one_thread()
def density_score(request: DensityScoreRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Add log densities to a table.

    Returns:
        `summary`: `file`, `rows`, and the `mean` log density in nats.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    density, extra = model_at(request.model)
    columns = request.columns or same_columns(request.data, extra)
    table = read_data(
        request.data,
        columns,
        None,
        tell,
        has_header=request.header,
        drop_missing=request.drop_missing,
    )
    points = density.space.to_chart(table.values)
    parts = []
    with torch.no_grad():
        for start in range(0, len(points), BLOCK):
            cancel.check()
            block = points[start : start + BLOCK]
            parts.append(density.log_prob(block, measure=request.measure))
            tell(Progress(min(1.0, (start + BLOCK) / len(points)), "scoring"))
    scores = torch.cat(parts).numpy()
    write_atomic(request.out, append_column(table, request.data, "log_prob", scores))
    tell(Written(request.out))
    mean = float(scores.mean())
    tell(
        Note(f"mean log density {mean:.4f} nats over {len(scores)} rows; written to {request.out}")
    )
    return Finished("done", {"file": str(request.out), "rows": len(scores), "mean": mean})


@one_thread()
def density_sample(request: DensitySampleRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Draw samples.

    Returns:
        `summary`: `file` and `rows`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
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


@one_thread()
def density_patches(request: PatchesRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Turn patches into angles on the Klein bottle.

    Returns:
        `summary`: `file`, `rows`, and how many farther ones were `left_out`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    table = read_data(request.data, request.columns, None, tell)
    angles, distances = to_klein(table.values, unit=request.unit)
    near = distances <= (np.inf if request.farthest is None else request.farthest)
    if not near.any():
        raise OrbiflowError(
            f"none of {len(near)} patches is within {request.farthest:g} of the Klein bottle; the "
            f"nearest is {distances.min():.3f} away"
            if len(near)
            else f"{request.data}: no patches"
        )
    found = np.column_stack([angles, distances])[near]
    cancel.check()
    write_atomic(request.out, to_csv(("theta", "phi", "distance"), found))
    tell(Written(request.out))
    left_out = int((~near).sum())
    left = f", {left_out} farther ones left out" if left_out else ""
    tell(
        Note(
            f"{near.sum()} patches, half of them within {np.median(found[:, 2]):.3f} of the Klein "
            f"bottle{left}; written to {request.out}"
        )
    )
    summary = {"file": str(request.out), "rows": len(found), "left_out": left_out}
    return Finished("done", summary)
