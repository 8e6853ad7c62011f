"""Doing what the options ask for: a job in this process, its events on the terminal."""

from __future__ import annotations

from contextlib import nullcontext

import typer

from orbiflow.cli.interrupts import stopped_by_interrupt
from orbiflow.cli.terminal import Terminal
from orbiflow.jobs import (
    BatchRequest,
    DensityBatchRequest,
    DensityCvRequest,
    EscherizeRequest,
    Finished,
    Request,
    run,
)
from orbiflow.runtime import Cancel

KEEPING = (EscherizeRequest, BatchRequest, DensityBatchRequest, DensityCvRequest)
STATUS = {"done": 0, "nothing found": 1, "cancelled": 130}


def do(request: Request) -> None:
    """Run the job.

    Raises:
        OrbiflowError: for anything that the user can mend.
        typer.Exit: with status 1 if nothing was found, 130 after Ctrl-C.
    """
    import torch  # now, and not while options are read

    torch.set_num_threads(1)  # many small operations; and workers may be forked
    finished = _run(request)
    if STATUS[finished.state]:
        raise typer.Exit(STATUS[finished.state])


def do_many(request: BatchRequest | DensityBatchRequest | DensityCvRequest) -> None:
    """Run a batch or a cross-validation.

    Raises:
        OrbiflowError: for anything that the user can mend.
        typer.Exit: with status 1 if a file or a fit has no result, 130 after Ctrl-C.
    """
    if request.scheduler is None:
        import torch

        torch.set_num_threads(1)  # workers may be forked
    finished = _run(request)
    if STATUS[finished.state]:
        raise typer.Exit(STATUS[finished.state])
    if finished.summary["failed"] or finished.summary["nothing"]:
        raise typer.Exit(1)


def _run(request: Request) -> Finished:
    # only these have something to keep
    keeps = isinstance(request, KEEPING)
    stopping = stopped_by_interrupt() if keeps else nullcontext(Cancel())
    with stopping as cancel, Terminal() as terminal:
        return run(request, terminal, cancel)
