"""How one column goes with another, or with a covariate: the command trend."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from orbiflow import runtime
from orbiflow.density import models
from orbiflow.density.operations import covariates
from orbiflow.density.run_folder import write_file
from orbiflow.density.tables import check_table_name
from orbiflow.errors import SettingError, literal
from orbiflow.settings import DefaultText, Option, Range, Settings, is_a

if TYPE_CHECKING:
    from torch import Tensor

    from orbiflow.arrays import Array
    from orbiflow.density.fitting import Progress
    from orbiflow.density.inference import Trend
    from orbiflow.density.models import ConditionalDensity
    from orbiflow.density.spaces import Covariate, Torus
    from orbiflow.drawing import Picture

MOST_PANELS = 24
"""The most words of which each has a panel."""


class TrendSettings(Settings, group="Trend"):
    """At which values a trend is found, and what its intervals hold."""

    start: Annotated[float | None, DefaultText("where 2 % of the density lie below")] = None
    """The first value; of a covariate, the least of the fit, of a cyclic one 0."""

    end: Annotated[float | None, DefaultText("where 2 % lie above; of an angle a whole turn")] = (
        None
    )
    """The last value."""

    count: Annotated[int, Range(2, 1000), Option("-n")] = 41
    """Number of values."""

    levels: tuple[float, ...] = (0.5, 0.9)
    """What the intervals hold."""

    at: Annotated[tuple[str, ...], DefaultText("numbers at their medians, each word")] = ()
    """The other covariates, such as temperature=295,residue=GLY."""


@runtime.operation("density trend")
def trend(
    settings: TrendSettings = TrendSettings(),
    *,
    model: Annotated[Path, Option("--model", "-m")],
    of: str,
    along: str,
    out: Annotated[Path, Option("--out", "-o")] = Path("trend.csv"),
    on_event: runtime.Sink = runtime.ignore,
    cancel: runtime.Cancel = runtime.Cancel(),
) -> runtime.Outcome:
    """Find how one column goes with another or a covariate: its mean and intervals at many values.

    Writes a table and, beside it, a picture of the same name. Of a covariate of words, there are a mean
    and intervals for each; beside one, a panel for each word.

    Args:
        model: Folder that `orbiflow density fit` wrote, of angles or of angles beside real columns.
        of: The column whose mean is found.
        along: The column, or covariate, that is known.
        out: The table.
    """
    check_table_name(out)

    from orbiflow.density.operations.saved import model_at

    runtime.check_output_file(out, model)
    with runtime.one_thread():
        progress = runtime.progress_events(on_event, cancel)
        found = covariates.conditional_in(model)
        names = [] if found is None else found[0].covariates.names
        name = next((one for one in names if one.casefold() == along.casefold()), None)
        if found is not None and name is not None:
            density, extra = found
            drawn = _along_covariate(density, extra, of, name, settings, progress, on_event)
        elif settings.at:
            raise SettingError("{at} is for trends along a covariate of the fit; leave it out")
        else:
            drawn = _along_column(*model_at(model), of, along, settings, progress, on_event)
        picture = drawn.picture()
    image = out.with_suffix(".png")
    write_file(out, drawn.table(), on_event)
    words = f"the mean of {drawn.names[0]} along {drawn.names[1]}; written to {out}"
    write_file(image, picture.file(), on_event, words)
    return runtime.Outcome({"file": str(out), "picture": str(image), "rows": drawn.rows})


class _Drawn(NamedTuple):
    """Trends by the word that is known beside, "" if there is none.

    - `names`: The column whose mean it is, and what it is along.
    - `space`: The torus of both.
    - `words`: What the values are numbers of, if they are words.
    """

    trends: Mapping[str, Trend]
    names: tuple[str, str]
    space: Torus
    words: tuple[str, ...] = ()
    beside: str = ""

    @property
    def rows(self) -> int:
        """Rows of the table."""
        return sum(len(found.at) for found in self.trends.values())

    def table(self) -> bytes:
        """Return a row for each value, with the word beside it if there are such."""
        first = next(iter(self.trends.values()))
        heads = [*([self.beside] if self.beside else []), self.names[1], self.names[0]]
        for level in first.levels:
            heads += [f"{self.names[0]}_{end}_{100 * level:g}" for end in ("low", "high")]
        if first.log_density is not None:
            heads.append("log_density")
        lines: list[list[Any]] = []
        for word, found in self.trends.items():
            for k, value in enumerate(found.at.tolist()):
                cells: list[Any] = [word] if self.beside else []
                cells += [self.words[k] if self.words else value, float(found.mean[k])]
                for low, high in zip(found.low[k], found.high[k], strict=True):
                    cells += [float(low), float(high)]
                if found.log_density is not None:
                    cells.append(float(found.log_density[k]))
                lines.append([f"{own:.10g}" if is_a(own, float) else own for own in cells])
        return runtime.csv_bytes(heads, lines)

    def picture(self) -> Picture:
        """Return the picture of all of them."""
        from orbiflow.density import pictures

        return pictures.trend_picture(self.trends, self.space, self.names, words=self.words)


def _along_column(
    density: models.Density,
    extra: dict[str, Any],
    of: str,
    along: str,
    settings: TrendSettings,
    progress: Progress,
    tell: runtime.Sink,
) -> _Drawn:
    from orbiflow.density import inference
    from orbiflow.density.operations.saved import axes_of, names_of

    names = names_of(density, extra)
    first, second = axes_of([of, along], names, tell)
    called = names[first], names[second]
    density, first, second = inference.pair_alone(density, first, second, len(names))
    at = _values(density, second, settings)
    found = inference.trend(
        density, first, second, at, levels=settings.levels,
        tick=lambda share: progress(0.9 * share, "finding conditional densities"),
    )  # fmt: skip
    space = inference.check_torus(density.space, "trends").of_axes([first, second])
    return _Drawn({"": found}, called, space)


def _along_covariate(
    density: ConditionalDensity,
    extra: dict[str, Any],
    of: str,
    along: str,
    settings: TrendSettings,
    progress: Progress,
    tell: runtime.Sink,
) -> _Drawn:
    import numpy as np

    from orbiflow.density import inference
    from orbiflow.density.operations.saved import axes_of
    from orbiflow.density.spaces import Torus

    torus = inference.check_torus(density.space, "trends")
    names = [str(name) for name in extra.get("columns") or torus.columns]
    (axis,) = axes_of([of], names, tell)
    column = density.covariates.column(along)
    known, beside, panels = _others(density, along, settings.at, tell)
    values = (
        np.array(column.words)
        if column.words
        else np.linspace(*_ends(column, settings), settings.count)
    )
    count, done = len(values) * len(panels), 0
    trends: dict[str, Trend] = {}
    for word in panels:
        fixed = {**known, beside: word} if beside else known
        cells = {name: np.full(len(values), cell) for name, cell in fixed.items()}
        x = density.covariates.features({**cells, along: values})

        def densities(x: Tensor = x) -> Iterator[models.Density]:
            nonlocal done
            for row in x:
                progress(0.9 * done / count, "finding densities")
                done += 1
                yield density.at(row)

        at = np.arange(float(len(values))) if column.words else values
        trends[word] = inference.trend_of(densities(), axis, at, levels=settings.levels)
    space = Torus([torus.axes[axis], (0.0, 1.0)], unit=str(torus.unit))
    return _Drawn(trends, (names[axis], along), space, column.words, beside)


def _others(
    density: ConditionalDensity, along: str, given: Sequence[str], tell: runtime.Sink
) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Return the values of other covariates, one that has a panel for each word, and these words."""
    pairs = [covariates.pair_of(text) for text in given]
    said = {name.casefold() for name, _ in pairs}
    if along.casefold() in said:
        raise SettingError("{at} and {along} " + literal(f"both name {along!r}"))
    apart, beside, panels = [along], "", ("",)
    for own in density.covariates.columns:
        if own.name == along or own.name.casefold() in said:
            continue
        if own.line is not None:
            pairs.append((own.name, f"{own.line.middle:.6g}"))
            tell(runtime.Note(f"{own.name} is held at its median, {own.line.middle:.6g}"))
        elif own.words and not beside and len(own.words) <= MOST_PANELS:
            beside, panels = own.name, own.words
            apart.append(own.name)
    cells = covariates.values_of(density, pairs, apart)
    return {name: cell[0] for name, cell in cells.items()}, beside, panels


def _ends(column: Covariate, settings: TrendSettings) -> tuple[float, float]:
    """Return the first and the last value of a covariate of numbers."""
    low, high = (0.0, column.period) if column.period is not None else column.range
    return _in_order(low, high, settings)


def _in_order(low: float, high: float, settings: TrendSettings) -> tuple[float, float]:
    """Return what settings say, otherwise these ends."""
    low = low if settings.start is None else settings.start
    high = high if settings.end is None else settings.end
    if not low < high:
        raise SettingError(f"{{end}} must be above {{start}}, got {low:g} to {high:g}")
    return low, high


def _values(density: models.Density, axis: int, settings: TrendSettings) -> Array:
    """Return the values (n,) of a column at which a trend is found."""
    import numpy as np
    import torch

    from orbiflow.density import inference

    space = inference.check_torus(density.space, "trends")
    period = space.axes[axis].period
    low = space.axes[axis].first_turn * period
    high = low + period
    if not period:
        alone = inference.marginal(density, [axis])
        masses = torch.tensor([0.02, 0.98], dtype=torch.float64)
        low, high = alone.space.from_chart(alone.icdf(masses))[:, 0].tolist()
    return np.linspace(*_in_order(low, high, settings), settings.count)
