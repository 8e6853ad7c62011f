"""How one column goes with another, or with a covariate: the command trend."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow import runtime
from orbiflow.density import inference, pictures
from orbiflow.density.run_folder import write_file
from orbiflow.density.tables import check_table_name
from orbiflow.errors import SettingError, literal
from orbiflow.settings import DefaultText, Option, Range, Settings, is_a

if TYPE_CHECKING:
    from torch import Tensor

    from orbiflow.arrays import Array
    from orbiflow.density.fitting import Progress
    from orbiflow.density.inference import Trend
    from orbiflow.density.models import ConditionalDensity, Density
    from orbiflow.density.operations.saved import SavedDensity
    from orbiflow.density.spaces import Torus

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

    from orbiflow.density.operations.saved import SavedDensity

    runtime.check_output_file(out, model)
    with runtime.one_thread():
        progress = runtime.progress_events(on_event, cancel)
        saved = SavedDensity.read(model)
        conditional = saved.density.given
        names = [] if conditional is None else conditional.covariates.names
        name = next((name for name in names if name.casefold() == along.casefold()), None)
        if conditional is not None and name is not None:
            drawn = _along_covariate(conditional, saved, of, name, settings, progress, on_event)
        elif settings.at:
            raise SettingError("{at} is for trends along a covariate of the fit; leave it out")
        else:
            drawn = _along_column(saved, of, along, settings, progress, on_event)
        image = out.with_suffix(".png")
        contents = {out: drawn.content(".csv"), image: drawn.picture("png")}
    for path, content in contents.items():
        write_file(path, content, on_event)
    words = f"the mean of {drawn.names[0]} along {drawn.names[1]}; written to {out}"
    on_event(runtime.Note(words))
    rows = sum(len(part.at) for part in drawn.trends.values())
    return runtime.Outcome({"file": str(out), "picture": str(image), "rows": rows})


@dataclass(frozen=True)
class TrendAnswer(runtime.Answer):
    """Trends by the word that is known beside, "" if there is none.

    - `names`: The column whose mean it is, and what it is along.
    - `space`: The torus of both.
    - `labels`: What the values are numbers of, if they are words.
    - `beside`: The covariate of the words by which trends are known.
    """

    trends: Mapping[str, Trend]
    names: tuple[str, str]
    space: Torus
    labels: tuple[str, ...] = ()
    beside: str = ""

    def table(self) -> Iterator[dict[str, Any]]:
        """Yield a row for each value, with the word beside it if there are such."""
        name, along = self.names
        for word, part in self.trends.items():
            for k, value in enumerate(part.at.tolist()):
                row: dict[str, Any] = {self.beside: word} if self.beside else {}
                row |= {along: self.labels[k] if self.labels else value, name: float(part.mean[k])}
                for level, low, high in zip(part.levels, part.low[k], part.high[k], strict=True):
                    row |= {f"{name}_low_{100 * level:g}": float(low)}
                    row |= {f"{name}_high_{100 * level:g}": float(high)}
                if part.log_density is not None:
                    row["log_density"] = float(part.log_density[k])
                yield {key: f"{v:.10g}" if is_a(v, float) else v for key, v in row.items()}

    def picture(self, form: str) -> bytes:
        """Return the picture of all of them."""
        del form  # always pixels
        picture = pictures.trend_picture(self.trends, self.space, self.names, words=self.labels)
        return picture.file()


def _along_column(
    saved: SavedDensity,
    of: str,
    along: str,
    settings: TrendSettings,
    progress: Progress,
    tell: runtime.Sink,
) -> TrendAnswer:
    names = saved.columns
    first, second = saved.axes([of, along], tell)
    called = names[first], names[second]
    density, first, second = inference.pair_alone(saved.density, first, second, len(names))
    at = _values(density, second, settings)
    column_trend = inference.trend(
        density, first, second, at, levels=settings.levels,
        tick=lambda share: progress(0.9 * share, "finding conditional densities"),
    )  # fmt: skip
    space = inference.check_torus(density.space, "trends").of_axes([first, second])
    return TrendAnswer({"": column_trend}, called, space)


def _along_covariate(
    density: ConditionalDensity,
    saved: SavedDensity,
    of: str,
    along: str,
    settings: TrendSettings,
    progress: Progress,
    tell: runtime.Sink,
) -> TrendAnswer:
    import numpy as np

    from orbiflow.density.spaces import Torus

    torus = inference.check_torus(density.space, "trends")
    (axis,) = saved.axes([of], tell)
    column = density.covariates.column(along)
    others, beside, panels = _others(density, along, settings.at, tell)
    low, high = (0.0, column.period) if column.period is not None else column.range
    values = (
        np.array(column.words)
        if column.words
        else np.linspace(*_in_order(low, high, settings), settings.count)
    )
    count, done = len(values) * len(panels), 0
    trends: dict[str, Trend] = {}
    for word in panels:
        fixed = {**others, beside: word} if beside else others
        cells = {name: np.full(len(values), cell) for name, cell in fixed.items()}
        x = density.covariates.features({**cells, along: values})

        def densities(x: Tensor = x) -> Iterator[Density]:
            nonlocal done
            for row in x:
                progress(0.9 * done / count, "finding densities")
                done += 1
                yield density.at(row)

        at = np.arange(float(len(values))) if column.words else values
        trends[word] = inference.trend_of(densities(), axis, at, levels=settings.levels)
    space = Torus([torus.axes[axis], (0.0, 1.0)], unit=str(torus.unit))
    return TrendAnswer(trends, (saved.columns[axis], along), space, column.words, beside)


def _others(
    density: ConditionalDensity, along: str, given: Sequence[str], tell: runtime.Sink
) -> tuple[dict[str, Any], str, tuple[str, ...]]:
    """Return the values of other covariates, one that has a panel for each word, and these words."""
    from orbiflow.density.operations.saved import pair_of, values_of

    pairs = [pair_of(text) for text in given]
    said = {name.casefold() for name, _ in pairs}
    if along.casefold() in said:
        raise SettingError("{at} and {along} " + literal(f"both name {along!r}"))
    apart, beside, panels = [along], "", ("",)
    for column in density.covariates.columns:
        if column.name == along or column.name.casefold() in said:
            continue
        if column.line is not None:
            pairs.append((column.name, f"{column.line.middle:.6g}"))
            tell(runtime.Note(f"{column.name} is held at its median, {column.line.middle:.6g}"))
        elif column.words and not beside and len(column.words) <= MOST_PANELS:
            beside, panels = column.name, column.words
            apart.append(column.name)
    cells = values_of(density, pairs, apart)
    return {name: cell[0] for name, cell in cells.items()}, beside, panels


def _in_order(low: float, high: float, settings: TrendSettings) -> tuple[float, float]:
    """Return what settings say, otherwise these ends."""
    low = low if settings.start is None else settings.start
    high = high if settings.end is None else settings.end
    if not low < high:
        raise SettingError(f"{{end}} must be above {{start}}, got {low:g} to {high:g}")
    return low, high


def _values(density: Density, axis: int, settings: TrendSettings) -> Array:
    """Return the values (n,) of a column at which a trend is found."""
    import numpy as np
    import torch

    space = inference.check_torus(density.space, "trends")
    period = space.axes[axis].period
    low = space.axes[axis].first_turn * period
    high = low + period
    if not period:
        alone = inference.marginal(density, [axis])
        masses = torch.tensor([0.02, 0.98], dtype=torch.float64)
        low, high = alone.space.from_chart(alone.icdf(masses))[:, 0].tolist()
    return np.linspace(*_in_order(low, high, settings), settings.count)
