"""How the studio is started, and what it takes at most."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from orbiflow.settings import Count, DefaultText, Option, Range, Seed, Settings

LOOPBACK = ("127.0.0.1", "localhost", "::1")


class StudioSettings(Settings, group="Server"):
    """Where the studio is reached, and where it keeps its projects."""

    port: Annotated[int, Range(1, 65535)] = 8437
    """Port of the server."""

    data: Annotated[Path | None, DefaultText("a folder of the user's for data")] = None
    """Folder that keeps all projects, made if need be."""

    browser: Annotated[bool, Option("--browser", off="--no-browser")] = True
    """Open a browser."""

    host: str = "127.0.0.1"
    """Address that the server listens on. With another than this machine's own, whoever comes must
    bring the token that is printed."""

    @property
    def is_local(self) -> bool:
        """Whether only this machine reaches the server."""
        return self.host in LOOPBACK


class Job(Settings):
    """A task as its worker knows it."""

    project: Path
    """Folder of the project."""

    task: Count
    """Number of the task, from which it numbers what it makes."""


class Limits(Settings):
    """What the server takes at most."""

    upload: Count = 64 * 2**20
    """Bytes of a file that is uploaded."""

    message: Count = 2 * 2**20
    """Bytes of any other body."""

    seconds: Annotated[float, Range(above=0)] = 20.0
    """Longest wait for the next part of a body."""

    slowest: Annotated[float, Range(0)] = 20_000.0
    """Bytes a second of a body, on average after the longest wait."""

    uploads: Count = 16
    """Bodies that are received at a time."""

    projects: Count = 1000
    """Projects."""

    waiting: Count = 20
    """Tasks of one project that are not done."""

    streams: Count = 100
    """Streams of events at a time."""


class TakeAway(Settings):
    """What is made of a tile to take away."""

    makes: str
    """The operation that makes it: export, art, solid or animate."""

    tile: int
    """The number of the tile."""

    settings: str = "{}"
    """Its settings, as JSON."""

    picture: bool = False
    """Whether the pictures that were uploaded go onto the figures."""

    drawing: str = ""
    """What was drawn on the tile, as JSON."""


class SearchChoice(Settings, group="Search"):
    """How tiles are searched for in the studio."""

    effort: Literal["fast", "normal"] = "normal"
    """How long the search takes: some seconds, or about twice as long."""

    objective: Literal["likeness", "overlap"] = "likeness"
    """With likeness, the picture bends until it is a tile; with overlap, the tile covers the picture
    as it is."""

    classes: tuple[str, ...] | None = None
    """Ways that the copies may lie, such as IH4 and IH6. Default: all that suit the picture."""

    like: Annotated[int | None, Range(1)] = None
    """Number of a tile: look for more tiles whose copies lie like its copies."""

    seed: Seed = 0
    """Start of the random numbers: another one gives other tiles."""
