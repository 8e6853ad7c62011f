"""A project as one file, NAME.orbiflow: to keep, to give away, and to go on with in Python.

It is a zip archive with project.json, the picture as it was uploaded, what was painted over it, and a
folder for each tile as `EscherTile.save` writes it. What a browser shows is made anew when a file is
opened: the picture is read again, and each tile is certified again, so a file needs no trust.
"""

from __future__ import annotations

import json
import re
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from orbiflow.errors import InputFileError, OrbiflowError, system_errors
from orbiflow.runtime import is_object
from orbiflow.settings import as_path
from orbiflow.studio.tile_files import PLACES, best_stage, tile_folder
from orbiflow.studio.words import MASKS, OF_PICTURE

if TYPE_CHECKING:
    from orbiflow.tiles import EscherTile, ReadingSettings, Target

FORMAT = "orbiflow-project/1"
PROJECT, ENDING = "project.json", ".orbiflow"
INPUT = re.compile(r"input(-2)?\.[a-z0-9]{1,7}")
TILE = re.compile(
    r"tiles/([1-9][0-9]{0,14})/(result\.json|[A-Za-z0-9-]{1,20}/model(-2)?\.safetensors)"
)
PAINTED = tuple(f"{mask}{end}.png" for end in OF_PICTURE for mask in MASKS)
MAX_VIEW = 200_000  # characters of what pages remember of a project
MAX_ENTRIES = 4 * PLACES
MAX_BYTES = 512 * 2**20  # of all entries, unpacked
MAX_ENTRY_BYTES = 64 * 2**20
DAMAGE_ERRORS = (zlib.error, EOFError, struct.error, KeyError, IndexError, TypeError, OverflowError)


@dataclass(frozen=True, eq=False)
class StudioProject:
    """A project of the studio, read from its file.

    - `name`: Its name.
    - `target`: The silhouette; None if there was no picture yet.
    - `second`: That of a second picture, if there was one.
    - `tiles`: Its tiles, each certified again, best first.
    - `numbers`: The number of each tile in the studio, and of the tile that it was made from by hand.
    - `document`: What else the file says.
    """

    name: str
    target: Target | None
    second: Target | None
    tiles: tuple[EscherTile, ...]
    numbers: tuple[tuple[int, int | None], ...]
    document: Mapping[str, Any]


def write_project(home: Path, document: Mapping[str, Any], out: Path) -> None:
    """Write the files of a project, and what is known of it, into one file.

    Args:
        home: The project's folder.
        document: Its name, kind, view and reading; its input's name; the same of a `second` picture;
            and `tiles`, each with its `id`, its `parent`, and whether it is `outdated`.
        out: The file.
    """
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr(PROJECT, json.dumps({"format": FORMAT, **document}, allow_nan=False))
        inputs = (file for end in OF_PICTURE for file in home.glob(f"input{end}.*"))
        for file in (*inputs, *(home / name for name in PAINTED)):
            if file.exists():
                archive.write(file, file.name, zipfile.ZIP_STORED)
        for number in (tile["id"] for tile in document["tiles"]):
            if best_stage(home, number) is None:
                continue
            folder = tile_folder(home, number)
            for file in sorted(folder.rglob("*")):
                if file.is_file():
                    archive.write(file, f"tiles/{number}/{file.relative_to(folder).as_posix()}")


def open_project(path: str | Path) -> StudioProject:
    """Read a project's file.

    Raises:
        InputFileError: If it is not one, is damaged, or is too large.

    >>> open_project("no such.orbiflow")
    Traceback (most recent call last):
    orbiflow.errors.InputFileError: no such.orbiflow: cannot be read: No such file or directory; ...
    """
    with tempfile.TemporaryDirectory() as folder:
        home = Path(folder)
        document = unpack(as_path(path, "the project's file"), home)
        tiles = read_tiles(home, document)
        target, second = read_pictures(home, document)
        return StudioProject(
            str(document["name"]),
            target,
            second,
            tuple(tile for tile, _, _ in tiles),
            tuple((number, parent) for _, number, parent in tiles),
            document,
        )


def unpack(path: Path, home: Path) -> dict[str, Any]:
    """Unpack what is known of a project's file into an empty folder; return what project.json says.

    Raises `InputFileError` if it is not such a file, is damaged, or is too large.
    """
    cure = "give a file that the studio saved"
    with system_errors(InputFileError, f"{path.name}: cannot be read", cure):
        try:
            with zipfile.ZipFile(path) as archive:
                _unpack_entries(archive, home)
            document = json.loads((home / PROJECT).read_text(encoding="utf-8"))
        except (zipfile.BadZipFile, FileNotFoundError, NotImplementedError) as error:
            if not path.exists():
                raise
            raise InputFileError(f"{path.name}: not a project of the studio; {cure}") from error
        except (*DAMAGE_ERRORS, ValueError, RuntimeError) as error:
            if isinstance(error, OrbiflowError):
                raise
            raise InputFileError(f"{path.name}: its contents are damaged; {cure}") from error
    return _checked(document, path)


def _unpack_entries(archive: zipfile.ZipFile, home: Path) -> None:
    entries = archive.infolist()
    if len(entries) > MAX_ENTRIES:
        raise InputFileError(f"the project has {len(entries)} files; {MAX_ENTRIES} can be read")
    left = MAX_BYTES
    for entry in entries:
        name = entry.filename
        if not (name in (PROJECT, *PAINTED) or INPUT.fullmatch(name) or TILE.fullmatch(name)):
            continue  # of a later version, or of somebody else
        # what an entry says of its size may be a lie: no more is read
        with archive.open(entry) as source:
            content = source.read(min(left, MAX_ENTRY_BYTES) + 1)
        left -= len(content)
        if len(content) > MAX_ENTRY_BYTES or left < 0:
            raise InputFileError(f"the project is too large: {name} or all of it, unpacked")
        place = home / name
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(content)


def _checked(document: object, path: Path) -> dict[str, Any]:
    if not is_object(document) or document.get("format") != FORMAT:
        raise InputFileError(f"{path.name}: not a project of the studio, or of a later version")
    plain = {"name": str, "kind": str, "view": dict, "reading": dict, "tiles": list}
    for name, kind in plain.items():
        if not isinstance(document.setdefault(name, kind()), kind):
            raise InputFileError(f"{path.name}: {name} in {PROJECT} is damaged")
    if len(json.dumps(document["view"])) > MAX_VIEW:
        raise InputFileError(f"{path.name}: its view is too large; save it again with less drawing")
    return document


def reading_of(document: Mapping[str, Any], number: int = 0) -> tuple[str, ReadingSettings]:
    """Return what a picture was called, and how it was read."""
    from orbiflow.tiles import ReadingSettings

    about = document.get("second") if number else document
    about = about if is_object(about) else {}
    uploaded, reading = about.get("input"), about.get("reading", {})
    called = uploaded.get("name") if is_object(uploaded) else None
    reading = reading if is_object(reading) else {}
    return str(called or "picture")[:80], ReadingSettings(**reading)


def read_pictures(home: Path, document: Mapping[str, Any]) -> list[Target | None]:
    """Read the first and the second picture in an unpacked project again; None for one that is not."""
    from orbiflow.studio.silhouette_file import read_input

    return [
        read_input(home, *reading_of(document, number), number)
        if any(home.glob(f"input{end}.*"))
        else None
        for number, end in enumerate(OF_PICTURE)
    ]


def _with_maps(tile: EscherTile) -> EscherTile:
    """Return a tile with its maps, or those of its figures, read."""
    return tile.with_figures(lambda figure: figure.changed(map_source=figure.map))


def read_tiles(home: Path, document: Mapping[str, Any]) -> list[tuple[EscherTile, int, int | None]]:
    """Return the certified tiles in an unpacked project, each with its number and its parent's."""
    from orbiflow.tiles import read_result

    tiles: list[tuple[EscherTile, int, int | None]] = []
    for entry in document["tiles"][:PLACES]:
        number = entry.get("id") if is_object(entry) else None
        if type(number) is not int or not (home / "tiles" / str(number) / "result.json").is_file():
            continue
        tile = read_result(home / "tiles" / str(number))
        tile.require_certified(otherwise="so the project cannot be opened; save it again")
        tile = _with_maps(tile)  # their files may go
        parent = entry.get("parent")
        tiles.append((tile, number, parent if type(parent) is int else None))
    return tiles


def ancestors(number: int, parents: Mapping[int, int | None]) -> list[int]:
    """Return the tiles that a tile was made from by hand, its parent first, as far as they are known.

    >>> ancestors(3, {1: None, 2: 1, 3: 2, 4: 77})
    [2, 1]
    """
    chain: list[int] = []
    parent = parents.get(number)
    while parent is not None and parent in parents and parent not in (number, *chain):
        chain.append(parent)
        parent = parents.get(parent)
    return chain


def outdated_tiles(document: Mapping[str, Any]) -> set[int]:
    """Return the numbers of the tiles that were found for another outline than the file's."""
    entries = [entry for entry in document["tiles"] if is_object(entry)]
    old = [entry.get("id") for entry in entries if entry.get("outdated") is True]
    return {number for number in old if type(number) is int}
