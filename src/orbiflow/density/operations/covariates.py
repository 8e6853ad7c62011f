"""Densities where covariates are known: what fit writes of them beside that of all rows, and scores."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from orbiflow import runtime
from orbiflow.density import covariates, inference, tables
from orbiflow.density.run_folder import CONDITIONAL
from orbiflow.errors import InputFileError, OrbiflowError, SettingError, literal

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from orbiflow.arrays import Array
    from orbiflow.density.covariates import ConditionalDensity, ConditionalReport, Values
    from orbiflow.density.estimator import DensityEstimator
    from orbiflow.density.fitting import Progress
    from orbiflow.density.models import Density
    from orbiflow.density.tables import RowSettings, TableRows

KIND = re.compile(r"(?P<name>.+):(?P<kind>word|real|[0-9.]+)", re.IGNORECASE)
"""How a column that is given says what it is: by a word, or its period."""

MISSING = frozenset({"", "na", "n/a", "nan", "null", "none"})
"""Cells that hold no value."""

MOST_NUMBERS_SHARE = 0.5
"""The share of numbers among cells from which one doubts that a column holds words."""

MOST_LISTED = 60
"""The most words of which a table is told."""


class Given(NamedTuple):
    """A column that is known: its name, and whether it is a "word", "real", a period, or None."""

    name: str
    kind: str | None


def given_columns(wanted: Sequence[str], names: Sequence[str] | None) -> list[Given]:
    """Return the columns that are given as NAME, NAME:word, NAME:real or NAME:24, a period.

    >>> given_columns(["hour:24", "residue"], ["phi", "hour", "residue"])
    [Given(name='hour', kind='24'), Given(name='residue', kind=None)]
    """
    found: list[Given] = []
    for text in wanted:
        match = KIND.fullmatch(text)
        if match and (names is None or text.casefold() not in {own.casefold() for own in names}):
            found.append(Given(match["name"], match["kind"].lower()))
        else:
            found.append(Given(text, None))
    return found


def asked_columns(given: Sequence[str], data: Path, reading: RowSettings) -> list[Given]:
    """Return the columns of a table that are given to a fit, which must be one of whole rows."""
    if not given:
        return []
    covariates.check_complete(reading.kept_missing)
    return given_columns(given, tables.column_names(data, has_header=reading.header))


class GivenCells(NamedTuple):
    """The rows of a table, the cells (N,) of its columns that are given, and cyclic ones' periods."""

    rows: TableRows
    cells: dict[str, Values]
    periods: dict[str, float | None]


def read_given(rows: TableRows, given: Sequence[Given], reading: RowSettings) -> GivenCells:
    """Return what is given of the rows of a table: numbers, or words where a cell is no number.

    Rows that lack a value are left out if missing ones are.
    """
    import numpy as np

    dropped = reading.drop_missing or reading.missing == "drop"
    cells: dict[str, Values] = {}
    periods: dict[str, float | None] = {}
    for name, kind in given:
        if name.casefold() in {own.casefold() for own in [*rows.table.columns, *cells]}:
            raise SettingError(
                literal(f"{name!r}")
                + " is among the columns of the density and {given}, or twice in "
                "{given}; leave one out"
            )
        cells[name] = _cells(rows, name, kind, reading, dropped=dropped)
        if kind is not None:
            periods[name] = None if kind in ("word", "real") else float(kind)
    if dropped and cells:
        kept = np.logical_and.reduce([~_is_missing(own) for own in cells.values()])
        rows = rows.only(kept)
        cells = {name: own[kept] for name, own in cells.items()}
    return GivenCells(rows, cells, periods)


def _cells(
    rows: TableRows, name: str, kind: str | None, reading: RowSettings, *, dropped: bool
) -> Values:
    """Return the cells (N,) of a column, as numbers if they are."""
    import numpy as np

    words = tables.read_labels(rows.path, name, rows.table, has_header=rows.header, empty=dropped)
    missing = np.array([word.casefold() in MISSING for word in words])
    if kind == "word" or (kind is None and tables.holds_words(rows.path, name)):
        return words
    numbers = np.full(len(words), np.nan)
    is_number = missing.copy()
    for row in np.flatnonzero(~missing):
        text = tables.with_minus(words[row])
        if rows.table.decimal == ",":
            text = text.replace(".", "").replace(",", ".")
        try:
            numbers[row] = float(text)
            is_number[row] = True
        except ValueError:
            continue
    numbers[np.isin(numbers, reading.missing_codes)] = np.nan
    if is_number.all():
        return numbers
    (line, word), *_ = zip(rows.table.lines[~is_number].tolist(), words[~is_number], strict=True)
    if kind is not None or (is_number & ~missing).mean() > MOST_NUMBERS_SHARE:
        raise InputFileError(
            f"{rows.path}: column {name!r} has {str(word)!r} in line {line}, and numbers otherwise: "
            f"correct it, or give {name}:word"
        )
    return words


def _is_missing(cells: Values) -> NDArray[Any]:
    import numpy as np

    if cells.dtype.kind == "f":
        return np.isnan(cells)
    return np.array([word.casefold() in MISSING for word in cells])


def fit_given(
    estimator: DensityEstimator,
    given: GivenCells,
    turn: float | None,
    tell: runtime.Sink,
    cancel: runtime.Cancel,
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return the file of the density where covariates are known, and what the report says of it.

    `turn` is that of the data's angles.
    """
    rows = given.rows
    known = covariates.Covariates.of(given.cells, given.periods, turn, tables.CURE)
    for own in known.columns:
        tell(runtime.Note(f"took {own.name} as {own.kind}"))
    for doubt in known.fit_doubts(given.cells):
        tell(runtime.Note(f"WARNING: {doubt}"))
    density, report = covariates.fit_conditional(
        estimator.density_,
        estimator.points_of(rows.table.values),
        known.features(given.cells),
        known,
        estimator.settings(),
        weights=rows.weights,
        groups=rows.labels,
        progress=runtime.progress_events(tell, cancel),
    )
    columns = list(rows.table.columns)
    said: dict[str, Any] = {"covariates": known.to_json(), **report.to_json()}
    words = {
        own.name: _by_word(density, report, given, own.name, own.words)
        for own in known.columns
        if own.words
    }
    for name, lines in words.items():
        tell(_table(name, columns, lines))
    for text in report.words():
        tell(runtime.Note(text))
    file = covariates.conditional_to_bytes(density, columns=columns)
    return {CONDITIONAL: file}, {"given": {**said, "words": words}}


def _by_word(
    density: ConditionalDensity,
    report: ConditionalReport,
    given: GivenCells,
    name: str,
    words: Sequence[str],
) -> dict[str, Any]:
    """Return rows, gain and, if nothing else is given, the mean of each column, for each word."""
    import numpy as np

    cells = given.cells[name]
    at, gains = (own.numpy() for own in report.held)
    means = None
    if len(given.cells) == 1 and _has_means(density):
        x = density.covariates.features({name: np.array(words)})
        turns = density.mean_directions(x)
        means = density.space.from_chart(turns).tolist()
    found: dict[str, Any] = {}
    for number, word in enumerate(words):
        own = gains[cells[at] == word]
        error = float(own.std(ddof=1) / np.sqrt(len(own))) if len(own) > 1 else None
        found[word] = {
            "rows": int((cells == word).sum()),
            "gain": float(own.mean()) if len(own) else None,
            "gain_error": error,
            "mean": None if means is None else means[number],
        }
    return found


def _has_means(density: ConditionalDensity) -> bool:
    """Return whether the data are angles."""
    from orbiflow.density.spaces import MixedTorus, Torus

    return isinstance(density.space, Torus) and not isinstance(density.space, MixedTorus)


def _table(column: str, names: Sequence[str], said: Mapping[str, Any]) -> runtime.Table:
    """Return what came of each word, a line for each."""

    def shown(value: float | None, form: str) -> str:
        return "-" if value is None else f"{value:{form}}"

    has_means = any(own["mean"] is not None for own in said.values())
    lines = [
        (
            word,
            str(own["rows"]),
            shown(own["gain"], ".3f"),
            shown(own["gain_error"], ".3f"),
            *(shown(value, ".3g") for value in own["mean"] or ()),
        )
        for word, own in list(said.items())[:MOST_LISTED]
    ]
    means = [f"mean {name}" for name in names] if has_means else []
    heads = (column, "rows", "nats", "error", *means)
    return runtime.Table(f"Rows held out where {column} is known", heads, tuple(lines))


def conditional_in(folder: Path) -> tuple[ConditionalDensity, dict[str, Any]] | None:
    """Return the density where covariates are known that is in the folder of a fit, if there is one."""
    file = folder / CONDITIONAL
    return covariates.read_conditional(file) if folder.is_dir() and file.exists() else None


def columns_asked(density: ConditionalDensity, given: Sequence[str]) -> list[Given] | None:
    """Return the covariates of a density, if these are what is given; None if none of them is.

    Raises `SettingError` if some of them are, and others are not.
    """
    own = {one.name.casefold(): one for one in density.covariates.columns}
    asked = [one.name.casefold() for one in given_columns(given, density.covariates.names)]
    if not set(asked) & set(own):
        return None
    if set(asked) != set(own):
        raise SettingError(
            "{given} must name all covariates of the fit, "
            + literal(", ".join(density.covariates.names))
        )
    return [Given(one.name, "word" if one.words else "real") for one in density.covariates.columns]


def score_given(
    density: ConditionalDensity,
    given: GivenCells,
    measure: str,
    tell: runtime.Sink,
    progress: Progress,
) -> Array:
    """Return log densities (N,) of rows, each where its covariates are."""
    import numpy as np

    known = density.covariates
    try:
        x = known.features(given.cells)
    except OrbiflowError as error:
        text = f"{given.rows.path}: {error}; leave such rows out, or score without what is given"
        raise InputFileError(text) from error
    for doubt in known.doubts(given.cells, tables.CURE):
        tell(runtime.Note(f"WARNING: {doubt}"))
    points = inference.chart_of_rows(density.space, given.rows.table.values, may_lack=False)
    found: list[Array] = []
    for start in range(0, len(points), BLOCK_ROWS):
        part = slice(start, start + BLOCK_ROWS)
        found.append(density.log_prob(points[part], x[part], measure=measure).numpy())
        progress(min(1.0, (start + BLOCK_ROWS) / len(points)), "scoring")
    return np.concatenate(found)


BLOCK_ROWS = 4_096
"""Rows scored at a time."""


def density_at(
    density: ConditionalDensity, pairs: Sequence[tuple[str, str]], tell: runtime.Sink
) -> Density:
    """Return the density where covariates have the values that texts say, each by its name.

    Raises `SettingError` for a covariate without a value, one that there is not, and no number.
    """
    x = density.covariates.features(cells := values_of(density, pairs))
    for doubt in density.covariates.doubts(cells):
        tell(runtime.Note(f"WARNING: {doubt}"))
    return density.at(x[0])


def values_of(
    density: ConditionalDensity, pairs: Sequence[tuple[str, str]], apart: Sequence[str] = ()
) -> dict[str, Values]:
    """Return the value (1,) of each covariate but those `apart`, by its name, as `density_at`."""
    import numpy as np

    texts = {name.casefold(): text for name, text in pairs}
    names = density.covariates.names
    if unknown := sorted(set(texts) - {name.casefold() for name in names}):
        raise SettingError(
            "{given}: " + literal(f"no covariate {unknown[0]!r}; there are {', '.join(names)}")
        )
    found: dict[str, Values] = {}
    for own in density.covariates.columns:
        text = texts.get(own.name.casefold())
        if own.name in apart:
            continue
        if text is None:
            raise SettingError(
                "{given} must say all that is known: " + literal(f"{own.name} is missing")
            )
        found[own.name] = np.array([text]) if own.words else np.array([number_of(own.name, text)])
    return found


def number_of(name: str, text: str) -> float:
    """Return the number that a text is."""
    try:
        return float(tables.with_minus(text.strip()))
    except ValueError:
        raise SettingError(
            "{given}: " + literal(f"{name} must be a number, got {text!r}")
        ) from None


def pair_of(text: str) -> tuple[str, str]:
    """Return the name and the value of a text such as temperature=295."""
    name, sign, value = text.rpartition("=")
    if not sign or not name.strip() or not value.strip():
        raise SettingError(f"{{given}} must be values such as psi=-45, got {literal(repr(text))}")
    return name.strip(), value.strip()
