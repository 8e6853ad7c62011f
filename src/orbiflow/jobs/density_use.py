"""Image patches as angles on the Klein bottle: the job of a `PatchesRequest`."""

from __future__ import annotations

import numpy as np

from orbiflow.density import (
    listing,
    to_csv,
    to_klein,
)
from orbiflow.errors import OrbiflowError
from orbiflow.jobs.density_data import (
    read_data,
)
from orbiflow.jobs.density_requests import (
    PatchesRequest,
)
from orbiflow.jobs.place import check_place
from orbiflow.jobs.run import Sink
from orbiflow.jobs.wording import counted
from orbiflow.runtime import (
    Cancel,
    Finished,
    Note,
    Written,
    one_thread,
    write_atomic,
)

PATCH_WIDTHS = (8, 9)
"""Columns of image patches."""


@one_thread()
def density_patches(request: PatchesRequest, tell: Sink, cancel: Cancel) -> Finished:
    """Turn patches into angles on the Klein bottle.

    Returns:
        `summary`: `file`, `rows`, and how many farther ones were `left_out`.

    Raises:
        OrbiflowError: for anything that the user can mend.
        Cancelled: if it was told to stop; nothing is written.
    """
    check_place(request.out, request.data)
    table = read_data(
        request.data,
        request.columns,
        tell,
        header=request.header,
        drop_missing=request.drop_missing,
    )
    if len(table.columns) not in PATCH_WIDTHS:
        raise OrbiflowError(
            f"{request.data}: a patch has 9 pixel values or 8 DCT coordinates, and there "
            f"{'is' if len(table.columns) == 1 else 'are'} {counted(len(table.columns), 'column')} "
            f"({listing(table.columns)}): choose with --columns"
        )
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
