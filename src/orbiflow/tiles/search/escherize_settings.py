"""Settings of a search for tiles."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from orbiflow.settings import (
    Count,
    DefaultText,
    Group,
    Needs,
    OnlyWith,
    Parsed,
    Range,
    Repeated,
    Seed,
    Settings,
)

if TYPE_CHECKING:
    from orbiflow.tiles.search.search_method import SearchMethod


LIKENESS = Group("Search for likeness")
OVERLAP = Group("Search for overlap")
OCCUPANCY = Group("Occupancy method")

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
    """Number of tiles of each class: the best, and others that differ from it."""

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
        given = {name: value for name, value in values.items() if value is not None}
        return kind.for_effort(self.effort, **given) if kind.efforts else kind(**given)


class EscherizeSettings(SearchSettings, group="Search"):
    """How tiles are looked for that look like one silhouette."""

    emphasis: Annotated[Path | None, OnlyWith(method="descent")] = None
    """A mask, white where the silhouette must survive, such as a head or a tail."""

    strength: Annotated[float | None, Range(above=0), Needs("emphasis"), DefaultText("4")] = None
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

    workers: Annotated[int | None, Range(1), DefaultText("one per core")] = None
    """Number of processes. Python calls default to 1."""
