"""Settings of a search for tiles."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.settings import (
    Count,
    DefaultText,
    HelpHeading,
    Needs,
    OnlyWith,
    Parsed,
    Range,
    Repeated,
    Seed,
    Settings,
)

if TYPE_CHECKING:
    from orbiflow.tiles.search.pair_search import PairSearch
    from orbiflow.tiles.search.search_method import Goal, SearchMethod
    from orbiflow.tiles.silhouette import Target


LIKENESS = HelpHeading("Search for likeness")
OVERLAP = HelpHeading("Search for overlap")
OCCUPANCY = HelpHeading("Occupancy method")
TWO = HelpHeading("Two silhouettes")

LEAST_RATIO = 0.1  # of the areas of two figures
BACKGROUND_RATIO = (0.15, 0.6)

METHODS = {
    "likeness": ("orbiflow.tiles.search", "LikenessSearch"),
    "overlap": ("orbiflow.tiles.flowing", "OverlapSearch"),
    "occupancy": ("orbiflow.tiles.flowing", "OccupancySearch"),
}
"""Where each search method is, by objective or method: only the one that is used is imported."""


def class_names(text: str) -> tuple[str, ...]:
    """Return the isohedral classes that a text names, or "all".

    >>> class_names("IH4, IH6"), class_names("all")
    (('IH4', 'IH6'), ('all',))
    """
    return tuple(filter(None, re.split(r"[,\s]+", text)))


def area_ratios(text: str) -> tuple[float, float]:
    """Return the least and the largest ratio that a text gives.

    >>> area_ratios("1"), area_ratios("0.8-1.25")
    ((1.0, 1.0), (0.8, 1.25))
    """
    match = re.fullmatch(r"\s*([\d.]+)\s*(?:-\s*([\d.]+))?\s*", text)
    try:
        low, high = (float(part) for part in (match[1], match[2] or match[1])) if match else (0, 0)
    except ValueError:
        low = high = 0
    if not LEAST_RATIO <= low <= high <= 1 / LEAST_RATIO:
        raise OrbiflowError(
            f"{text!r} is no ratio of areas from {LEAST_RATIO:g} to {1 / LEAST_RATIO:g}; write one, "
            "such as 1, or the least and the largest, such as 0.8-1.25"
        )
    return low, high


class SearchSettings(Settings, group="Search"):
    """Which tiles are looked for, how, and for how long, whatever the silhouette."""

    classes: Annotated[
        tuple[str, ...] | None,
        Parsed(class_names, "classes such as IH4,IH6, or all", "CLASSES"),
        DefaultText("the nine, and some with symmetric tiles for a silhouette near to symmetric"),
    ] = None
    """Isohedral classes, such as IH4,IH6. With all, classes with symmetric tiles are searched whatever
    the silhouette."""

    effort: Annotated[Literal["fast", "normal"], OnlyWith(method="descent")] = "normal"
    """How long the search takes: some seconds, or about twice as long."""

    objective: Annotated[Literal["likeness", "overlap"], OnlyWith(method="descent")] = "likeness"
    """With likeness, the silhouette bends until it is a tile, and every limb is kept. With overlap,
    the tile covers the silhouette as it is."""

    method: Literal["descent", "occupancy"] = "descent"
    """The descent, or the paper's occupancy loss for comparison."""

    per_class: Count = 1
    """Number of tiles of each class: the best, and others that differ from it. Of two silhouettes the
    best pairs come, whatever their classes."""

    min_neck: Annotated[float, Range(0, 0.2), OnlyWith(method="descent")] = 0.01
    """Tiles with necks thinner than this rank lower; in square roots of the tile's area."""

    max_frequency: Annotated[
        int | None, Range(0, 60), OnlyWith(objective="overlap"), OVERLAP, DefaultText("10")
    ] = None
    """Largest frequency of the deformation (Omega in the paper)."""

    turns: Annotated[Count | None, OnlyWith(method="occupancy"), OCCUPANCY, DefaultText("12")] = (
        None
    )
    """Number of starting rotations."""

    iterations: Annotated[
        Count | None, OnlyWith(method="occupancy"), OCCUPANCY, DefaultText("200")
    ] = None
    """Number of steps of the fit."""

    ratio: Annotated[
        tuple[float, float] | None,
        Parsed(area_ratios, "a number, or two with a dash, such as 0.8-1.25", "RATIO"),
        DefaultText("0.6-1.7, of a background 0.15-0.6"),
        OnlyWith(method="descent", objective="likeness"),
        TWO,
    ] = None
    """Area of the second figure over the first, before they bend, or the least and the largest."""

    seed: Seed = 0
    """Seed of the random numbers: the same seed on the same machine gives the same tiles."""

    force: bool = False
    """Keep tiles that are not certified, marked so."""

    def defaults(self) -> Mapping[str, Any]:
        return {"objective": "overlap"} if self.method == "occupancy" else {}

    @property
    def search_method(self) -> SearchMethod:
        """The method that is asked for: with what is set here, and otherwise its own defaults."""
        module, name = METHODS[self.objective if self.method == "descent" else self.method]
        kind: Any = getattr(import_module(module), name)
        shared = {entry.name for entry in fields(kind)} & {entry.name for entry in fields(self)}
        values = {name: getattr(self, name) for name in shared - {"method"}}
        values = {name: value for name, value in values.items() if value is not None}
        return kind.for_effort(self.effort, **values) if kind.efforts else kind(**values)


class EscherizeSettings(SearchSettings, group="Search"):
    """How tiles are looked for that look like one silhouette."""

    emphasis: Annotated[Path | None, OnlyWith(method="descent")] = None
    """A mask, white where the silhouette must survive, such as a head or a tail."""

    strength: Annotated[float | None, Range(above=0), DefaultText("4")] = None
    """How many times more the white part of the mask counts."""

    pin: Annotated[
        tuple[str, ...] | None,
        Repeated(),
        OnlyWith(method="descent", objective="likeness"),
        LIKENESS,
    ] = None
    """A part that keeps its shape while the rest bends: x,y or x,y,radius in the coordinates of the
    input, or a mask that is white where pinned. May be repeated."""

    pin_angle: Annotated[bool, Needs("pin"), LIKENESS] = False
    """Keep the angle of what is pinned, too."""

    background: Annotated[bool, OnlyWith(method="descent", objective="likeness"), TWO] = False
    """Let the second figure be what the first one leaves, of any shape. Give one silhouette."""

    second_emphasis: Annotated[
        Path | None, OnlyWith(method="descent", objective="likeness"), TWO
    ] = None
    """A mask, white where the second silhouette must survive."""

    second_pin: Annotated[
        tuple[str, ...] | None, Repeated(), OnlyWith(method="descent", objective="likeness"), TWO
    ] = None
    """A part of the second silhouette that keeps its shape, as for the first. May be repeated."""

    workers: Annotated[int | None, Range(1), DefaultText("one per core")] = None
    """Number of processes. Python calls default to 1."""

    def check(self) -> None:
        super().check()
        if self.strength is not None and not (self.emphasis or self.second_emphasis):
            raise SettingError("{strength} needs {emphasis}; give both or neither")

    @property
    def files(self) -> list[Path]:
        """The files that are read besides the silhouettes, if pins are files."""
        pins = (*(self.pin or ()), *(self.second_pin or ()))
        masks = (self.emphasis, self.second_emphasis)
        return [*(mask for mask in masks if mask is not None), *map(Path, pins)]

    def check_single(self) -> None:
        """Raise a `SettingError` for what applies only to two silhouettes."""
        for name in ("second_emphasis", "second_pin", *(() if self.background else ("ratio",))):
            if getattr(self, name) is not None:
                raise SettingError(
                    f"{{{name}}} needs a second silhouette; give one or leave it out"
                )

    def goal(self, target: Target) -> Goal:
        """Return the silhouette with what matters in it."""
        from orbiflow.tiles.search.search_method import Goal

        values: dict[str, Any] = {
            "emphasis": self.emphasis,
            "pin": self.pin,
            "keep_angle": self.pin_angle,
        }
        return Goal.read(target, strength=self.strength, **values)

    def second_goal(self, target: Target) -> Goal:
        """Return the same for the second silhouette."""
        from orbiflow.tiles.search.search_method import Goal

        values: dict[str, Any] = {"emphasis": self.second_emphasis, "pin": self.second_pin}
        return Goal.read(target, strength=self.strength, **values)

    @property
    def pair_search(self) -> PairSearch:
        """The search for two silhouettes."""
        from orbiflow.tiles.search.pair_search import PairSearch

        if self.method != "descent" or self.objective != "likeness":
            raise SettingError(
                "two silhouettes are searched for likeness; leave out {objective} and {method}"
            )
        usual = BACKGROUND_RATIO if self.background else None
        values = {"classes": self.classes, "ratio": self.ratio or usual}
        values = {name: value for name, value in values.items() if value is not None}
        shared = {"min_neck": self.min_neck, "seed": self.seed, "workers": self.workers or 1}
        return PairSearch.for_effort(self.effort, force=self.force, **shared, **values)
