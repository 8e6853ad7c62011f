"""The rows of a cross-validation, what they weigh and which of them belong together."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.arrays import Array
from orbiflow.density import (
    LEAST_PLACES,
    Space,
    Table,
    chart_of_observed,
    places,
    read_labels,
    space_class,
    weighed,
)
from orbiflow.density.tables import angle_unit
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_cv_requests import DensityCvRequest
from orbiflow.jobs.density_data import read_beside_groups
from orbiflow.jobs.density_fit import WIDTH
from orbiflow.jobs.density_requests import Unit
from orbiflow.jobs.run import Sink
from orbiflow.runtime import Note


@dataclass(frozen=True, eq=False)
class CvRows:
    """Of a table, those that count.

    - `table`: N rows, in the data's own units. `weights`: (N,), None where all weigh the same.
    - `labels`: (N,) the group of each row, None if there are none.
    - `together`: (N,) a label a row; rows of one label are on one side of every split.
    - `space`, `unit`: of the whole table, for its measure; no fit sees it.
    """

    table: Table
    weights: Array | None
    labels: NDArray[np.str_] | None
    together: NDArray[Any] | None
    space: Space
    unit: Unit

    @property
    def whole(self) -> NDArray[np.bool_]:
        """Which rows lack nothing: of others the density is in another unit."""
        found = np.logical_and.reduce(np.isfinite(self.table.values), axis=1)
        return found if found.any() else np.ones_like(found)


def read_rows(request: DensityCvRequest, tell: Sink) -> CvRows:
    """
    Raises:
        OrbiflowError: for a table, columns, weights or groups that cannot be used.
    """
    table, weights = _counting(*read_beside_groups(request, WIDTH[request.space], tell))
    unit = angle_unit(request.space, request.unit, table, tell)
    space = space_class(request.space).for_data(table.values, unit=unit, seed=request.seed)
    points = (
        chart_of_observed(space, table.values)
        if request.missing == "marginalise"
        else space.to_chart(table.values)
    )
    counts, place = places(points)
    if len(counts) <= LEAST_PLACES:
        raise OrbiflowError(
            f"{request.data}: {len(counts)} different rows; a cross-validation needs more than the "
            f"{LEAST_PLACES} that a density needs"
        )
    labels = None
    if request.group is not None:
        labels = read_labels(request.data, request.group, table, has_header=request.header)
    together: NDArray[Any] | None = labels
    if labels is None and request.repeats == "rounding":
        together = place.numpy()
    elif request.repeats == "rounding":
        tell(Note("groups are kept together; equal rows of different groups may be on both sides"))
    return CvRows(table, weights, labels, together, space, unit)


def _counting(table: Table, weights: Array | None) -> tuple[Table, Array | None]:
    """Without the rows of weight 0, which count for nothing."""
    if weights is None:
        return table, None
    weighed(torch.zeros(len(weights), 1), weights)  # refuses what is no weight
    kept = weights > 0
    left = frozenset(table.lines[~kept].tolist())
    kept_table = replace(
        table,
        values=table.values[kept],
        lines=table.lines[kept],
        dropped=table.dropped | left,
    )
    return kept_table, weights[kept]
