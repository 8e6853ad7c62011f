"""Choices and options of a search that `escherize` and `batch` share."""

from __future__ import annotations

import re
from enum import StrEnum
from typing import Annotated

import typer


class Method(StrEnum):
    """How tiles are fitted."""

    DESCENT = "descent"
    OCCUPANCY = "occupancy"


class Objective(StrEnum):
    """What a tile is to be good at."""

    LIKENESS = "likeness"
    OVERLAP = "overlap"
    BOTH = "both"


class Effort(StrEnum):
    """How long the descent searches."""

    FAST = "fast"
    NORMAL = "normal"
    BEST = "best"


Classes = Annotated[str, typer.Option(help="Isohedral classes, such as IH4,IH6, or all.")]
ChosenEffort = Annotated[
    Effort | None,
    typer.Option(
        help="Seconds, a quarter of a minute, or minutes; default normal.", show_default=False
    ),
]
ChosenObjective = Annotated[
    Objective | None,
    typer.Option(
        help="Likeness: the silhouette bends until it is a tile, every limb kept. Overlap: the "
        "tile covers the silhouette as it is. Both: a short list of the best compromises. Default "
        "likeness.",
        show_default=False,
    ),
]
PerClass = Annotated[
    int, typer.Option(help="Tiles of each class, the best and others that differ from it.")
]
MinNeck = Annotated[
    float | None,
    typer.Option(
        help="Tiles with necks thinner than this rank lower; in square roots of the area, "
        "default 0.01.",
        show_default=False,
    ),
]
MaxFrequency = Annotated[
    int | None,
    typer.Option(
        help="Overlap: detail of the deformation (Omega in the paper), 0 to 60; default 10, or "
        "15 for effort best.",
        show_default=False,
    ),
]
Seed = Annotated[int, typer.Option(help="Same seed, same machine: same tiles.")]
ChosenMethod = Annotated[
    Method, typer.Option(help="The descent, or the paper's occupancy loss for comparison.")
]
Turns = Annotated[
    int | None,
    typer.Option(help="Occupancy: starting rotations, default 12.", show_default=False),
]
Iterations = Annotated[
    int | None,
    typer.Option(help="Occupancy: steps of the fit, default 200.", show_default=False),
]
Figures = Annotated[
    bool,
    typer.Option(
        "--figures",
        help="Also for print: tiling.pdf, overlay.pdf; and the flow: field.png, field.pdf.",
    ),
]
Threshold = Annotated[
    float | None,
    typer.Option(help="Level between shape and background, 0 to 1; default: found out."),
]
Invert = Annotated[
    bool | None,
    typer.Option("--invert/--no-invert", help="The shape is the light part; default: found out."),
]
Force = Annotated[
    bool, typer.Option("--force", help="Keep tiles that are not certified, marked so.")
]


def named_classes(text: str) -> tuple[str, ...] | None:
    """`--classes` as a request takes it.

    >>> named_classes("IH4, IH6"), named_classes("all")
    (('IH4', 'IH6'), None)
    """
    if text.strip().lower() == "all":
        return None
    return tuple(filter(None, re.split(r"[,\s]+", text)))
