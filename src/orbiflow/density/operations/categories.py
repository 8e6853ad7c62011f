"""Densities where a word is known: the files that fit writes beside that of all rows, and scores."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow import runtime
from orbiflow.density import models, pictures, tables
from orbiflow.density.run_folder import CATEGORY_FILE, category_files
from orbiflow.errors import DataWarning, InputFileError, OrbiflowError, literal
from orbiflow.settings import SettingError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

    from orbiflow.arrays import Array
    from orbiflow.density.categories import CategoryDensity
    from orbiflow.density.estimator import DensityEstimator
    from orbiflow.density.tables import TableRows


DRAWS = 2**14
"""Draws of which a mean is taken: integrals over the marginal density of a flow take long."""

FIGURES = {"own": ("weight", ".2f"), "nats": ("gain", ".3f"), "error": ("gain_error", ".3f")}
"""Figures of a category in the table: the weight of its own density, and what it gains."""


def words_in(rows: TableRows, column: str) -> NDArray[np.str_]:
    """Return the word (N,) of each row of a table in another column of its file."""
    found = replace(rows, group=column).labels
    assert found is not None
    return found


def fit_words(
    estimator: DensityEstimator,
    rows: TableRows,
    column: str,
    tell: runtime.Sink,
    cancel: runtime.Cancel,
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return a model for each word of a column, by its file's name, and what the report says."""
    from orbiflow.density.categories import fit_categories

    if column in rows.table.columns:
        raise SettingError(
            literal(f"{column!r}")
            + " is among the columns of the density and {given}; leave one out"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DataWarning)  # notes have said the same
        found = fit_categories(
            estimator,
            rows.table.values,
            words_in(rows, column),
            sample_weight=rows.weights,
            groups=rows.labels,
            progress=runtime.progress_events(tell, cancel),
        )
    files: dict[str, bytes] = {}
    said: dict[str, Any] = {}
    columns = list(rows.table.columns)
    for word, own in found.items():
        name = _free_name(word, files)
        files[name] = models.density_to_bytes(own.estimator.density_, columns=columns)
        said[word] = {"file": name, "rows": own.rows, "weight": own.weight, "gain": own.gain}
        said[word] |= {"gain_error": own.gain_error, "mean": _mean(own), "note": own.note}
    tell(_table(column, columns, said))
    for word, own in found.items():
        if own.note:
            tell(runtime.Note(f"{word}: the density of all rows, since {own.note}"))
    example = next(iter(files))
    tell(runtime.Note(f"{len(files)} models where {column} is known, such as {example}"))
    return files, {"given": column, "categories": said}


def _mean(own: CategoryDensity) -> list[float] | None:
    """Return the mean of each column, on tori of draws, or None where points have none."""
    import numpy as np

    from orbiflow.density.spaces import Torus

    space = own.estimator.space_
    if not isinstance(space, Torus):
        try:
            return own.estimator.mean().tolist()
        except OrbiflowError:
            return None
    found: list[float] = []
    for axis, drawn in enumerate(own.estimator.sample(DRAWS, random_state=0).T):
        period = space.period_of(axis)
        around = np.exp(2j * np.pi * drawn / period).mean() if period else 0
        turn = np.angle(around) / (2 * np.pi)
        turn += turn < space.first_turn(axis)
        found.append(float(turn * period if period else drawn.mean()))
    return found


def _free_name(word: str, taken: Mapping[str, bytes]) -> str:
    """Return a file's name for a word, which no other has, on a disk that ignores case either."""
    plain = re.sub(r"[^A-Za-z0-9_+-]", "_", word)[:40]
    lower = {name.casefold() for name in taken}
    names = (
        CATEGORY_FILE.format(f"{plain}{end}") for end in ("", *(f"_{k}" for k in range(2, 2000)))
    )
    return next(name for name in names if name.casefold() not in lower)


def _table(column: str, names: Sequence[str], said: Mapping[str, Any]) -> runtime.Table:
    """Return what came of each category, a line for each."""

    def shown(value: float | None, form: str) -> str:
        return "-" if value is None else f"{value:{form}}"

    lines = [
        (
            word,
            str(own["rows"]),
            *(shown(own[key], form) for key, form in FIGURES.values()),
            *(shown(value, ".3g") for value in own["mean"] or [None] * len(names)),
        )
        for word, own in said.items()
    ]
    heads = (column, "rows", *FIGURES, *(f"mean {name}" for name in names))
    return runtime.Table(f"Densities where {column} is known", heads, tuple(lines))


def word_column(model: Path, given: Sequence[str]) -> str | None:
    """Return the column of words that is given, if the models in a folder are of its words."""
    if not (given and category_files(model)):
        return None
    document = json.loads((model / pictures.REPORT).read_text(encoding="utf-8"))
    column = str(document["given"])
    return column if [one.casefold() for one in given] == [column.casefold()] else None


def score_words(
    model: Path,
    rows: TableRows,
    column: str,
    score: Callable[[models.Density, Tensor], Array],
    may_lack: bool,
) -> Array:
    """Return log densities (N,) of rows, each where its word in a column is known."""
    import numpy as np

    from orbiflow.density import inference

    files, words = category_files(model), words_in(rows, column)
    unknown = sorted(set(words.tolist()) - set(files))
    if unknown:
        raise InputFileError(
            f"{rows.path}: column {column!r} has {tables.listing(unknown)}, and the model knows "
            f"{tables.listing(list(files))}; leave those rows out, or score them without what is given"
        )
    found = np.empty(len(words))
    for word in np.unique(words).tolist():
        density, _ = models.read_density(model / files[word])
        own = words == word
        values = rows.table.values[own]
        points = inference.chart_of_rows(density.space, values, may_lack=may_lack)
        found[own] = score(density, points)
    return found
