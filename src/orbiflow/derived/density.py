"""Fitting a density to a table."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

from orbiflow.runtime import Cancel, Outcome, Sink, ignore, operation
from orbiflow.settings import (
    DefaultText,
    Group,
    NotWith,
    Option,
    Range,
    SettingError,
    Settings,
    Unit,
)

TABLE = Group("Reading the table")
FLOW = Group("Flow")


class TableSettings(Settings, group="Reading the table"):
    """Which columns and rows of a table are read."""

    columns: Annotated[tuple[str, ...] | None, DefaultText("what the space takes")] = None
    """Names or numbers of the columns, such as lat,lon."""

    header: Annotated[bool | None, DefaultText("found automatically")] = None
    """Whether the table's first line names the columns."""

    drop_missing: bool = False
    """Leave out rows that lack a value."""

    missing: Literal["refuse", "drop", "marginalise"] = "refuse"
    """What is done with rows that lack a value. With marginalise, on tori, they count by the angles
    that they have."""

    weights: str | None = None
    """Column, by name or number, that says how much each row counts; only ratios matter."""

    def check(self) -> None:
        if self.drop_missing and self.missing == "marginalise":
            raise SettingError(
                "{drop_missing} leaves out the rows that {missing} marginalise would use; give one"
            )


class DensitySettings(Settings, group="Density"):
    """How a density is fitted."""

    space: Literal["torus", "sphere", "klein-bottle", "projective-plane"]
    """Where the data live."""

    unit: Annotated[
        Literal["radians", "degrees", "turns"] | None,
        DefaultText("radians, if no value is beyond 2 pi"),
    ] = None
    """Unit of angles on the torus and the Klein bottle."""

    group: Annotated[str | None, NotWith("kernels", because="a flow alone has no choice")] = None
    """Column that names what rows belong to (a protein, a station, an event): those of one are not
    independent."""

    parts: Annotated[
        tuple[Literal["flow", "kernels", "mixture", "chains", "network"], ...] | None,
        NotWith("kernels", because="{kernels} is a flow with kernels"),
        DefaultText("all, and held-out rows choose"),
    ] = None
    """Components that may be used, such as kernels,mixture."""

    repeats: Literal["places", "rounding"] = "places"
    """What rows that repeat another are: places that new rows repeat as often, or an accident of
    rounding."""

    detail: Annotated[int | None, Range(1, 64), FLOW, DefaultText("what suits the rows")] = None
    """Waves of the flow along a side of the square."""

    segments: Annotated[int | None, Range(1, 256), FLOW, DefaultText("what suits the rows")] = None
    """Number of stationary pieces of the flow."""

    kernels: Annotated[bool, FLOW] = False
    """A flow with adaptive kernels, and nothing else."""

    seconds: Annotated[float | None, Range(0), Unit("s"), DefaultText("no limit")] = None
    """Maximum training time."""

    seed: Annotated[int, Range(-(2**63), 2**64 - 1)] = 0
    """Seed of the random numbers: the same seed on the same machine gives the same density."""

    def check(self) -> None:
        if self.group is not None and self.parts == ("flow",):
            raise SettingError("{group} serves to choose among {parts}; a flow alone has no choice")
        for name in ("detail", "segments"):
            if getattr(self, name) is not None and "flow" not in (self.parts or ("flow",)):
                raise SettingError(
                    f"{{{name}}} needs a flow: add it to {{parts}}, or leave {{{name}}} out"
                )


@operation("density fit", starts_processes=False)
def fit(
    data: Path,
    settings: DensitySettings,
    out: Annotated[Path, Option("-o")] = Path("density"),
    table: TableSettings = TableSettings(),
    *,
    picture: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel = Cancel(),
) -> Outcome:
    """Fit a density: angles (torus), lat,lon or x,y,z (sphere), axes (projective plane) or theta,phi.

    Writes density.safetensors and report.json into the folder.

    Args:
        data: CSV, TSV, NPY or Parquet.
        out: Folder for the results, made if need be.
        picture: Also draw a small picture, thumbnail.png.
    """
    if table.missing == "marginalise":
        _check_marginalised(settings)

    import torch

    from orbiflow.jobs.density_fit import density_fit
    from orbiflow.jobs.density_requests import DensityFitRequest

    torch.set_num_threads(1)
    request = DensityFitRequest(
        data=data, out=out, picture=picture, **asdict(settings), **asdict(table)
    )
    finished = density_fit(request, on_event, cancel)
    return Outcome(finished.summary, finished.state)


def _check_marginalised(settings: DensitySettings) -> None:
    if settings.space != "torus":
        raise SettingError(
            f"{{missing}} marginalise is for angles on a torus: on the {settings.space} no coordinate "
            "is known without the other; use {missing} drop"
        )
    if settings.kernels or settings.parts == ("flow",):
        raise SettingError(
            "{missing} marginalise is for kernels and mixtures: a flow cannot be fitted to rows that "
            "lack angles; give other {parts}"
        )
