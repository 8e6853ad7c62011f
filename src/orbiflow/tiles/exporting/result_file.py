"""The tile to export, out of a run's folder."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from orbiflow.arguments import instance
from orbiflow.arguments import path as as_path
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.symmetry import (
    CrystallographicGroup,
    Isometry,
    checked_lattice,
)
from orbiflow.tiles.search import TileResult
from orbiflow.tiles.tilings import (
    CLASSES,
    Tile,
    isohedral_class,
)

RESULT = "result.json"
MOST_BYTES = 256 * 2**20


@dataclass(frozen=True, eq=False)
class ExportTile:
    """A tile and what its file says of it.

    - `tile`: in the input's coordinates.
    - `y_down`: whether y points down there, as in images.
    - `name`: such as "turtle-IH4", for titles and file names.
    - `rank`: its place in the run's list, from 1; None if it is not out of one.
    - `model`: the file of its map, which may be absent; None if it is not out of a folder.
    """

    tile: Tile
    y_down: bool = False
    name: str = "tile"
    rank: int | None = None
    model: Path | None = None

    @classmethod
    def of(cls, tile: TileSource) -> ExportTile:
        """From whatever holds a tile; of a run's folder, the best one.

        Raises:
            OrbiflowError: for what holds none.
            InputFileError: as `read_result`.
        """
        if isinstance(tile, ExportTile):
            return tile
        if isinstance(tile, str | Path):
            return read_result(tile)
        if isinstance(tile, TileResult):
            frame = tile.model.frame
            return cls(tile.tile, frame is not None and frame.y_down, tile.name)
        plain = instance(tile, Tile, "the tile", "read_result(folder) gives one")
        return cls(plain, name=plain.isohedral_class or "tile")


TileSource: TypeAlias = ExportTile | TileResult | Tile | str | Path
"""What the functions of this room take for a tile: a text or path is a run's folder, or its
result.json, whose best tile is meant; `read_result` gives the others."""


def read_result(path: str | Path, which: str | int = 1) -> ExportTile:
    """A tile of a run.

    Args:
        path: the run's folder, or its result.json.
        which: a class, such as "IH4" (its best tile), or a rank from 1, the best.

    Raises:
        InputFileError: if there is no such file, it is none of orbiflow's, or holds no such tile.
    """
    file, document = read_document(path)
    try:
        entries = document["tiles"]
        names = [str(entry["class"]) for entry in entries]
        y_down = bool(document["input"]["y_down"])
        source = Path(str(document["input"]["source"])).stem
    except (KeyError, TypeError) as error:
        missing = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputFileError(f"{file}: not a result of orbiflow escherize: {missing}") from error
    index = _index(names, which, file)
    try:
        tile = _tile(entries[index])
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputFileError(f"{file}: tile {index + 1} cannot be read: {error}") from error
    model = file.parent / folder_names(names)[index] / "model.safetensors"
    return ExportTile(tile, y_down, f"{source}-{names[index]}", index + 1, model)


def folder_names(classes: Iterable[str]) -> list[str]:
    """Of results of these classes; further tiles of a class are IH4-2, IH4-3 and so on.

    >>> folder_names(["IH4", "IH6", "IH4"])
    ['IH4', 'IH6', 'IH4-2']
    """
    seen: Counter[str] = Counter()
    names = []
    for name in classes:
        seen[name] += 1
        names.append(name if seen[name] == 1 else f"{name}-{seen[name]}")
    return names


def read_document(path: str | Path) -> tuple[Path, dict[str, Any]]:
    """The result.json of a run, and what it holds: an object with `tiles`.

    Args:
        path: the run's folder, or its result.json.

    Raises:
        InputFileError: if there is no such file, or it is none of orbiflow's.
    """
    given = as_path(path, "the result")
    file = given / RESULT if given.is_dir() else given
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputFileError(f"{file}: {file.stat().st_size:,} bytes is too large for a result")
        document = json.loads(file.read_bytes())
    except FileNotFoundError as error:
        if given.is_dir():
            what = f"{given} holds no {RESULT}; give the folder that orbiflow escherize wrote"
        else:
            what = f"{given}: no such file or folder; give what orbiflow escherize wrote"
        raise InputFileError(what) from error
    except OSError as error:
        raise InputFileError(f"{file}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise InputFileError(f"{file}: not JSON: {error}") from error
    if not isinstance(document, dict) or "tiles" not in document:
        raise InputFileError(f"{file}: not a result of orbiflow escherize: it names no tiles")
    return file, document


def _index(names: list[str], which: str | int, file: Path) -> int:
    if not names:
        raise InputFileError(f"{file}: the run found no tile, so there is none to export")
    text = str(which).strip()
    if text.isdecimal():
        if not 1 <= int(text) <= len(names):
            raise InputFileError(
                f"{file}: there is no tile of rank {text}; there are 1 to {len(names)}: "
                f"{', '.join(names)}"
            )
        return int(text) - 1
    name = isohedral_class(text).name
    if name not in names:
        raise InputFileError(f"{file}: holds no tile of {name}; there are {', '.join(names)}")
    return names.index(name)


def _tile(entry: dict[str, Any]) -> Tile:
    group = entry["group"]
    cosets = tuple(
        Isometry(np.array(coset["linear"]), np.array(coset["translation"]))
        for coset in group["cosets"]
    )
    if not cosets:
        raise OrbiflowError("its group has no cosets")
    name = str(entry["class"])
    ring = np.array(entry["polygon"], dtype=np.float64)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 4:
        raise OrbiflowError(f"its polygon should be a closed ring of points, got {ring.shape}")
    return Tile(
        ring[:-1],
        CrystallographicGroup(checked_lattice(group["lattice"]), cosets, str(group["name"])),
        name if name in CLASSES else "",
        tuple(entry["corners"]),
    )
