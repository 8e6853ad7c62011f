"""Choices and arguments that commands of `orbiflow density` share."""

from __future__ import annotations

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from orbiflow.jobs import RecordError


class Space(StrEnum):
    """Where the data live."""

    TORUS = "torus"
    SPHERE = "sphere"
    KLEIN_BOTTLE = "klein-bottle"
    PROJECTIVE_PLANE = "projective-plane"


class Unit(StrEnum):
    """Of angles."""

    RADIANS = "radians"
    DEGREES = "degrees"
    TURNS = "turns"


class Repeats(StrEnum):
    """What rows that repeat another are."""

    PLACES = "places"
    ROUNDING = "rounding"


class Missing(StrEnum):
    """What is done with rows that lack an angle."""

    REFUSE = "refuse"
    DROP = "drop"
    MARGINALISE = "marginalise"


class Measure(StrEnum):
    """What a density is per."""

    NATURAL = "natural"
    SQUARE = "square"
    UNIFORM = "uniform"


class Scale(StrEnum):
    """Of colours."""

    AUTO = "auto"
    LINEAR = "linear"
    LOG = "log"


class Projection(StrEnum):
    """Of maps."""

    AUTO = "auto"
    EQUAL_EARTH = "equal-earth"
    MOLLWEIDE = "mollweide"
    LATLON = "latlon"
    LAMBERT = "lambert"
    STEREOGRAPHIC = "stereographic"
    SCHMIDT = "schmidt"
    WULFF = "wulff"


class Format(StrEnum):
    """Of figures."""

    PNG = "png"
    PDF = "pdf"
    SVG = "svg"


Data = Annotated[Path, typer.Argument(help="CSV, TSV, NPY or Parquet.", show_default=False)]


def named_columns(text: str | None) -> tuple[str, ...] | None:
    """`--columns` as a request takes it.

    >>> named_columns(" lat , lon ")
    ('lat', 'lon')
    """
    return None if text is None else tuple(filter(None, re.split(r"\s*,\s*", text.strip())))


Columns = Annotated[
    str | None,
    typer.Option(help="Names or numbers of the columns, such as lat,lon.", show_default=False),
]
NoHeader = Annotated[
    bool, typer.Option("--no-header", help="The table's first line is a row, names or not.")
]
DropMissing = Annotated[
    bool, typer.Option("--drop-missing", help="Leave out rows that lack a value.")
]
MissingOption = Annotated[
    Missing,
    typer.Option(
        "--missing",
        help="Rows that lack a value: refuse, drop, or, on tori, marginalise: they count by the angles "
        "that they have.",
    ),
]
Weights = Annotated[
    str | None,
    typer.Option(
        help="Column, by name or number, that says how much each row counts; only ratios matter.",
        show_default=False,
    ),
]
Model = Annotated[
    Path, typer.Option("--model", "-m", help="Folder that `fit` wrote.", show_default=False)
]
Group = Annotated[
    str | None,
    typer.Option(
        help="Column that names what rows belong to (a protein, a station, an event): those of one "
        "are not independent.",
        show_default=False,
    ),
]
UnitOption = Annotated[
    Unit | None,
    typer.Option(
        "--unit",
        help="Of angles on the torus and the Klein bottle; default radians, if no value is beyond "
        "2 pi.",
        show_default=False,
    ),
]
Parts = Annotated[
    str | None,
    typer.Option(
        help="Of flow, kernels, mixture, chains and network those that may be used, such as "
        "kernels,mixture; default all, and rows held out choose.",
        show_default=False,
    ),
]
RepeatsOption = Annotated[
    Repeats,
    typer.Option(
        "--repeats",
        help="What rows that repeat another are: places that new rows repeat as often, or an "
        "accident of rounding.",
    ),
]


RegionSamples = Annotated[
    int | None,
    typer.Option(
        help="By which regions are known: 20000 tell a half within 0.35 %, and up to 0.9995. Default "
        "20000, or more where a mass needs it.",
        show_default=False,
    ),
]


def numbers_of(text: str | None, field: str) -> tuple[float, ...] | None:
    """Numbers with commas between them; None stays None.

    >>> numbers_of("0.5, 0.9", "mass")
    (0.5, 0.9)
    """
    if text is None:
        return None
    try:
        return tuple(float(part) for part in text.split(",") if part.strip())
    except ValueError as error:
        raise RecordError(f"{{{field}}} must be numbers such as 0.5,0.9, got {text!r}") from error
