"""What is made of a tile: its sheets, whose files any writer writes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from PIL import Image

from orbiflow.runtime import NEVER, Cancel, Outcome, write_atomic
from orbiflow.tiles.make.art_settings import ArtSettings
from orbiflow.tiles.make.export_settings import ExportSettings
from orbiflow.tiles.page import Scene
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.write import INCH, PAGED, TOLERANCE, scene_image, write_png, write_scene

SHOWN_PIXELS = 600
"""Pixels of the longer side of what a notebook shows."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Made(Outcome):
    """What was made of a tile.

    - `tile`: The tile, with its map if something lies on it.
    - `settings`: How it was made.
    - `scenes`: The sheets.
    - `counted`: What is counted on them, in words, such as "pieces".
    - `tiles`: The number of tiles on all sheets; one that is cut where sheets meet counts on each.
    - `world`: The world that they are in, if it is not the plane.
    - `notes`: What the user should know.
    - `files`: The files that were written: one for each sheet, or one of pages.
    """

    tile: EscherTile
    settings: ExportSettings | ArtSettings
    scenes: tuple[Scene, ...]
    counted: str
    tiles: float
    world: str = ""
    notes: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()

    @property
    def tile_size(self) -> float | None:
        """The longer side in mm of a tile's smallest rectangle, where all are alike."""
        return self.scenes[0].facts.get("tile_size")

    def content(self, sheet: int = 0, format: str | None = None) -> str | bytes:
        """Return the content of a file, in the settings' format unless another is given.

        It holds the sheet, and in a format of pages those that come after it.
        """
        settings = self.settings
        options: dict[str, Any] = {"tolerance": TOLERANCE}
        if isinstance(settings, ExportSettings):
            options = {"tolerance": settings.fine, "dxf": settings.dxf}
        form = format or settings.file_format
        first, *more = self.scenes[sheet : None if form in PAGED else sheet + 1]
        return write_scene(first, form, more=more, dpi=settings.dpi, **options)

    def image(self, sheet: int = 0) -> Image.Image:
        """Return a sheet as a picture in RGB, in the settings' resolution."""
        return scene_image(self.scenes[sheet], self.settings.pixels)

    def written(self, out: Path, cancel: Cancel = NEVER) -> Made:
        """Write the sheets, in numbered files if there are several; return what came of it.

        Every file is whole before the first is written.

        Raises:
            OutputError: If a file cannot be written.
            Cancelled: If it was cancelled; nothing is then written.
        """
        contents = list[str | bytes]()
        paged = self.settings.file_format in PAGED
        for number in range(1 if paged else len(self.scenes)):
            cancel.check()
            contents.append(self.content(number))
        cancel.check()
        names = sheet_names(out, len(contents))
        files = tuple(write_atomic(name, data) for name, data in zip(names, contents, strict=True))
        return replace(self, files=files, summary=self._facts(files))

    def _facts(self, files: tuple[Path, ...]) -> dict[str, Any]:
        """Return what JSON says of it."""
        facts = {"files": [str(file) for file in files], "tiles": self.tiles}
        facts |= {"class": self.tile.isohedral_class or "", "tile_size": self.tile_size}
        return {**facts, "world": self.world} if self.world else facts

    @property
    def words(self) -> str:
        """What was written, in a sentence."""
        where, sheets, files = str(self.files[0]), len(self.scenes), len(self.files)
        if files > 1:
            where = f"{files} sheets, {where} to {self.files[-1].name}"
        elif sheets > 1:
            where += f" of {sheets} pages"
        name, settings = self.tile.isohedral_class or "a tile", self.settings
        by, unit = (settings.pixels, "pixels") if isinstance(settings, ArtSettings) else (1.0, "mm")
        kind = f", {self.world}" if self.world else ""
        if self.tile_size is not None:
            kind = f", {self.tile_size * by:.4g} {unit} each"
        width, height = (side * by for side in (self.scenes[0].width, self.scenes[0].height))
        count = self.scenes[0].facts.get("pieces", self.tiles)
        return (
            f"written {where}: {count:.0f} {self.counted} of {name}{kind}, "
            f"on {width:.6g} x {height:.6g} {unit}"
        )

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows: the first sheet."""
        sheet = self.scenes[0]
        dpi = SHOWN_PIXELS * INCH / max(sheet.width, sheet.height)
        return write_png(sheet, dpi=min(dpi, self.settings.dpi))


def sheet_names(out: Path, count: int) -> list[Path]:
    """Return a name for each sheet, numbered if there are several.

    >>> [path.name for path in sheet_names(Path("cut.svg"), 2)]
    ['cut-1.svg', 'cut-2.svg']
    """
    if count == 1:
        return [out]
    digits = len(str(count))
    return [out.with_name(f"{out.stem}-{k:0{digits}d}{out.suffix}") for k in range(1, count + 1)]
