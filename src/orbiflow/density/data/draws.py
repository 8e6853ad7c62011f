"""Draws of samplers as rows: variables along chains and draws, as xarray and ArviZ hold them."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError

DRAWS = ("chain", "draw", "sample")
"""Dimensions along which there are rows: ArviZ's own, and the one in which it stacks them."""

RUNS = 10
"""Runs of neighbouring draws in each chain: those of one are held out together."""

LEAST_RUN = 2
"""Draws in a run, without which they are as good as apart."""


def posterior_of(data: Any) -> Any:
    """Return the posterior sample of ArviZ's InferenceData or xarray's DataTree, others as they are."""
    posterior = getattr(data, "posterior", None)
    return posterior if hasattr(posterior, "data_vars") else data


def has_draws(data: Any) -> bool:
    """Return whether a Dataset or a DataArray of xarray has draws along a dimension of its own."""
    return hasattr(data, "coords") and not set(DRAWS).isdisjoint(getattr(data, "dims", ()))


def columns_of_draws(data: Any, what: str) -> list[tuple[str, Any]]:
    """Return the names and columns (N,) of a Dataset or DataArray, chain after chain.

    A variable of more dimensions has a column for each entry, named as ArviZ names it: "torsion[phi]".

    Raises:
        OrbiflowError: For variables that have another value in no draw.
    """
    rows = [name for name in DRAWS if name in data.dims]
    if hasattr(data, "data_vars"):
        variables = [(str(name), data[name]) for name in data.data_vars]
    else:
        variables = [(str("x" if data.name is None else data.name), data)]
    found: list[tuple[str, Any]] = []
    for name, variable in variables:
        if not set(rows) <= set(variable.dims):
            raise OrbiflowError(
                f"{what}: variable {name!r} is not along {' and '.join(rows)}; choose those that are, "
                "such as dataset[['phi', 'psi']]"
            )
        others = [own for own in variable.dims if own not in rows]
        table = variable.transpose(*rows, *others).values
        columns = table.reshape(-1, *table.shape[len(rows) :])
        labels = [_labels(variable, own) for own in others]
        for place in itertools.product(*(range(len(own)) for own in labels)):
            entry = ", ".join(own[k] for own, k in zip(labels, place, strict=True))
            found.append((f"{name}[{entry}]" if others else name, columns[(slice(None), *place)]))
    return found


def _labels(variable: Any, dim: str) -> list[str]:
    """Return what the entries along a dimension are called, or else their numbers from 0."""
    named = variable.coords[dim].values if dim in variable.coords else range(variable.sizes[dim])
    return [str(label) for label in named]


def runs_of_draws(data: Any) -> NDArray[np.int64] | None:
    """Return the run (N,) of neighbouring draws in which each row lies, or None for other data.

    Draws of one chain are like the ones before, so that rows held out one by one would be known by
    their neighbours.
    """
    data = posterior_of(data)
    if not (has_draws(data) and "draw" in data.dims):
        return None
    draws, chains = int(data.sizes["draw"]), int(data.sizes.get("chain", 1))
    if draws < LEAST_RUN * RUNS:
        return None
    run = np.arange(draws) * RUNS // draws
    return (np.arange(chains)[:, None] * RUNS + run).ravel()
