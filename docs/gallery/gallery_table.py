"""The gallery's table: what is drawn, from what, and the commands that make it."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
TABLE = HERE / "gallery.toml"
OUT = "out/gallery"
"""Where commands write, under the project's root."""

FREE = ("CC0-1.0", "PDM-1.0", "MIT")
"""Licences that a source may have."""


@dataclass(frozen=True)
class Source:
    """Where silhouettes are from.

    - `text`: the licence's file under `docs/gallery`, or "" where the licence asks for none.
    """

    name: str
    by: str
    url: str
    licence: str
    text: str = ""


@dataclass(frozen=True)
class Entry:
    """One tiling.

    - `silhouette`, `drawing`: files, from the project's root.
    - `source`: of the silhouette, and `image`: which of the source's.
    - `second`, `second_drawing`, `second_source`, `second_image`: the same of the second figure, if the
      tile has two.
    - `art`: further options of `orbiflow art`, in order.
    - `search`: further options of `orbiflow escherize`.
    - `svg`: whether it is written as SVG, too.
    """

    name: str
    title: str
    say: str
    silhouette: str
    source: Source
    image: str
    tile: str
    drawing: str = ""
    second: str = ""
    second_drawing: str = ""
    second_source: Source | None = None
    second_image: str = ""
    size: str = "1000x750px"
    seed: int = 0
    art: tuple[str, ...] = ()
    search: tuple[str, ...] = ()
    svg: bool = False

    @property
    def picture(self) -> Path:
        """What the page shows."""
        return HERE / "pictures" / f"{self.name}.webp"

    @property
    def silhouettes(self) -> list[tuple[str, str, str, Source]]:
        """The silhouette, drawing, image and source of each figure."""
        first = (self.silhouette, self.drawing, self.image, self.source)
        if self.second_source is None:
            return [first]
        return [first, (self.second, self.second_drawing, self.second_image, self.second_source)]

    @property
    def made(self) -> str:
        """What the commands write, from the project's root."""
        return f"{OUT}/{self.name}.png"

    def commands(self) -> list[list[str]]:
        """What to type in the project's root, without the first word `orbiflow`."""
        folder = f"{OUT}/{self.name}"
        seed = ("--seed", str(self.seed)) if self.seed else ()
        both = [self.silhouette, self.second] if self.second else [self.silhouette]
        search = ["escherize", *both, "--classes", self.tile, *seed, *self.search]
        over = ["--picture", self.drawing] if self.drawing else []
        over += ["--second-picture", self.second_drawing] if self.second_drawing else []
        art = ["art", folder, *over, *self.art]
        found = [[*search, "--out", folder], [*art, "--area", self.size, "--out", self.made]]
        if self.svg:
            found.append([*art, "--area", self.size, "--out", f"{OUT}/{self.name}.svg"])
        return found


def read_table(path: Path = TABLE) -> list[Entry]:
    """The entries in the order of the page.

    Raises:
        ValueError: for a source or a key that is not known.
    """
    document = tomllib.loads(path.read_text(encoding="utf-8"))
    sources = {key: Source(**values) for key, values in document["source"].items()}
    return [_entry(values, sources) for values in document["entry"]]


def _entry(values: Mapping[str, Any], sources: Mapping[str, Source]) -> Entry:
    own = dict(values)
    for key in ("source", "second_source"):
        if key in own and own[key] not in sources:
            raise ValueError(f"{own.get('name')}: there is no source {own[key]!r}")
    source, second = sources[own.pop("source")], sources.get(own.pop("second_source", ""))
    try:
        return Entry(
            source=source,
            second_source=second,
            art=tuple(own.pop("art", ())),
            search=tuple(own.pop("search", ())),
            **own,
        )
    except TypeError as error:
        raise ValueError(f"{own.get('name')}: {error}") from error
