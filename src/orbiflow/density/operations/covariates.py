"""Densities where covariates are known: what fit writes of them beside that of all rows, and scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow import runtime
from orbiflow.density import data, fitting, inference, models, spaces, tables
from orbiflow.density.run_folder import CONDITIONAL
from orbiflow.errors import InputFileError, OrbiflowError, SettingError, literal

if TYPE_CHECKING:
    from orbiflow.arrays import Array
    from orbiflow.density.data import Asked, Role, TableRows
    from orbiflow.density.estimator import DensityEstimator
    from orbiflow.density.fitting import ConditionalReport, Progress
    from orbiflow.density.models import ConditionalDensity, Density
    from orbiflow.density.spaces import Values
    from orbiflow.density.tables import RowSettings

MOST_LISTED = 60
"""The most words of which a table is told."""


def asked_columns(given: Sequence[str], reading: RowSettings) -> Asked:
    """Return the columns of a table that are given to a fit, which must be one of whole rows."""
    if not given:
        return {}
    fitting.check_complete(reading.kept_missing)
    try:
        return data.asked_roles(given)
    except SettingError as error:
        raise SettingError(error.template.replace("{columns}", "{given}")) from error


def known_in(
    rows: TableRows, asked: Asked, unit: str | None, tell: runtime.Sink
) -> dict[str, Role]:
    """Return what is known of rows, by its name, before anything is fitted.

    `unit` is that of angles that name none.
    """
    roles = data.given_roles(list(rows.given), rows.given, asked, unit, where=rows.source.where)
    try:
        doubts = spaces.Covariates.of(rows.given, roles).fit_doubts(rows.given)
    except SettingError as error:
        refusal = data.in_file(error, rows.source.where)
        refusal.template = refusal.template.replace("{columns}", "{given}")
        raise refusal from error
    tell(runtime.Note(f"given: {_declaration(roles)}"))
    for doubt in doubts:
        tell(runtime.Note(f"WARNING: {doubt}"))
    return roles


def _declaration(roles: Mapping[str, Role]) -> str:
    return ",".join(f"{name}={role}" for name, role in roles.items())


def told(
    estimator: DensityEstimator, rows: TableRows, tell: runtime.Sink
) -> tuple[dict[str, bytes], dict[str, Any]]:
    """Return the file of the density where covariates are known, and what the report says of it."""
    density: ConditionalDensity = estimator.conditional_density_
    report: ConditionalReport = estimator.conditional_report_
    columns, kept = list(rows.columns), [role and str(role) for role in rows.roles]
    known = density.covariates
    said: dict[str, Any] = {
        "declaration": _declaration({own.name: own.role for own in known.columns}),
        "covariates": known.to_json(),
        **report.to_json(),
    }
    words = {
        own.name: _by_word(density, report, rows, own.name, own.words)
        for own in known.columns
        if own.words
    }
    for name, lines in words.items():
        tell(_table(name, columns, lines))
    for text in report.words():
        tell(runtime.Note(text))
    file = models.density_to_bytes(density, columns=columns, roles=kept)
    return {CONDITIONAL: file}, {"given": {**said, "words": words}}


def _by_word(
    density: ConditionalDensity,
    report: ConditionalReport,
    rows: TableRows,
    name: str,
    words: Sequence[str],
) -> dict[str, Any]:
    """Return rows, gain and, if nothing else is given, the mean of each column, for each word."""
    import numpy as np

    cells = data.words_of_cells(rows.given[name])
    at, gains = (own.numpy() for own in report.held)
    means = None
    if len(rows.given) == 1 and _has_means(density):
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
    return density.space.is_of_angles


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
    return models.read_conditional(file) if folder.is_dir() and file.exists() else None


def columns_asked(density: ConditionalDensity, given: Sequence[str]) -> list[str]:
    """Return the covariates of a density, if these are what is given; none if none of them is.

    Raises `SettingError` if some of them are, and others are not, and for other roles than the fit's.
    """
    own = {one.name.casefold(): one for one in density.covariates.columns}
    asked = {str(name).casefold(): role for name, role in data.asked_roles(given).items()}
    if not asked.keys() & own.keys():
        return []
    if asked.keys() != own.keys():
        raise SettingError(
            "{given} must name all covariates of the fit, "
            + literal(", ".join(density.covariates.names))
        )
    for name, role in asked.items():
        fitted = own[name].role
        same_turn = role is not None and role.turn is not None and role.turn == fitted.turn
        if role is not None and role != fitted and not same_turn:
            raise SettingError(
                f"{{given}}: {literal(own[name].name)} is declared as {role}, and in the fit it is "
                f"{fitted}: convert it, or leave the role out"
            )
    return density.covariates.names


def score_given(
    density: ConditionalDensity,
    rows: TableRows,
    measure: str,
    tell: runtime.Sink,
    progress: Progress,
) -> Array:
    """Return log densities (N,) of rows, each where its covariates are."""
    import numpy as np

    known = density.covariates
    cells = dict(zip(known.names, rows.given.values(), strict=True))
    try:
        x = known.features(cells)
        doubts = known.doubts(cells)
    except OrbiflowError as error:
        text = f"{rows.source.where}{error}; leave such rows out, or score without what is given"
        raise InputFileError(text) from error
    for doubt in doubts:
        tell(runtime.Note(f"WARNING: {doubt}"))
    points = inference.chart_of_rows(density.space, rows.values, may_lack=False)
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
            "{at}: " + literal(f"no covariate {unknown[0]!r}; there are {', '.join(names)}")
        )
    found: dict[str, Values] = {}
    for own in density.covariates.columns:
        text = texts.get(own.name.casefold())
        if own.name in apart:
            continue
        if text is None:
            raise SettingError(
                "{at} must say all that is known: " + literal(f"{own.name} is missing")
            )
        found[own.name] = np.array([text]) if own.words else np.array([number_of(own.name, text)])
    return found


def number_of(name: str, text: str) -> float:
    """Return the number that a text is."""
    try:
        return float(tables.with_minus(text.strip()))
    except ValueError:
        raise SettingError("{at}: " + literal(f"{name} must be a number, got {text!r}")) from None


def pair_of(text: str) -> tuple[str, str]:
    """Return the name and the value of a text such as temperature=295."""
    name, sign, value = text.rpartition("=")
    if not sign or not name.strip() or not value.strip():
        raise SettingError(f"{{at}} must be values such as psi=-45, got {literal(repr(text))}")
    return name.strip(), value.strip()
