"""What a command left in a folder, as the objects that Python made it of."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

from orbiflow.arguments import path as as_path
from orbiflow.density import (
    MODEL,
    REPORT,
    DensityEstimator,
    read_density,
    report_from_json,
)
from orbiflow.errors import (
    CertificationError,
    InputFileError,
    OrbiflowError,
)
from orbiflow.runtime import is_list
from orbiflow.tiles import (
    RESULT,
    Bending,
    Certificate,
    ExportTile,
    Frame,
    SavedModel,
    certify,
    folder_names,
    load_saved,
    read_document,
    read_result,
)

TILE_MODEL = "model.safetensors"
MOST_BYTES = 64 * 2**20
"""Of a report."""


@dataclass(frozen=True, eq=False)
class LoadedTile(ExportTile):
    """A tile of a run, for whatever takes a tile: `export`, `draw_art`, `animate`.

    Beside `tile` (the polygon with its group, in the input's coordinates), `y_down`, `name`, `rank` and
    `model`:

    - `certificate`: computed anew from the polygon and the group alone.
    - `entry`: what result.json says of it.
    - `saved`: the map as it is on disk, None if its file is not there.
    """

    certificate: Certificate | None = None
    entry: dict[str, Any] | None = None
    saved: SavedModel | None = None

    @property
    def isohedral_class(self) -> str:
        """Such as "IH4"."""
        return self.tile.isohedral_class

    @property
    def bending(self) -> Bending | None:
        """The map from the silhouette, in normal form; None of a tile for overlap."""
        return None if self.saved is None else self.saved.bending

    @property
    def frame(self) -> Frame | None:
        """Where the map's own coordinates lie in the input."""
        return None if self.saved is None else self.saved.frame


@dataclass(frozen=True, eq=False)
class LoadedRun:
    """The folder of `orbiflow escherize`.

    - `folder`: it. `tiles`: best first. `document`: result.json.
    """

    folder: Path
    tiles: tuple[LoadedTile, ...]
    document: dict[str, Any]

    @property
    def best(self) -> LoadedTile:
        """The first."""
        return self.tiles[0]

    def __len__(self) -> int:
        return len(self.tiles)

    def __iter__(self) -> Iterator[LoadedTile]:
        return iter(self.tiles)

    def __getitem__(self, which: str | int) -> LoadedTile:
        """By class, such as "IH4" (its best tile), or by rank from 1.

        Raises:
            OrbiflowError: if there is no such tile.
        """
        for tile in self.tiles:
            if which in (tile.isohedral_class, tile.rank):
                return tile
        names = ", ".join(dict.fromkeys(tile.isohedral_class for tile in self.tiles))
        raise OrbiflowError(
            f"{self.folder} holds no tile {which!r}; there are {names}, and ranks 1 to {len(self)}"
        )


def load(
    folder: str | Path, *, uncertified: bool = False
) -> DensityEstimator | LoadedRun | LoadedTile:
    """What a command left in a folder.

    - of `orbiflow density fit`: the fitted `DensityEstimator`, with `report_` and `feature_names_in_`;
    - of `orbiflow escherize`: a `LoadedRun`, whose tiles are certified anew;
    - of one of its tiles, such as `out/turtle/IH4`: the `LoadedTile`.

    Args:
        folder: or the file in it that counts: density.safetensors, result.json.
        uncertified: give tiles that do not tile, too; `certificate` says what is wrong.

    Raises:
        InputFileError: if there is no such folder, it holds neither or both, or a damaged file.
        CertificationError: for a tile that does not tile, unless it may be uncertified.
    """
    path = as_path(folder, "the folder")
    if path.is_dir():
        has = {name: (path / name).is_file() for name in (MODEL, RESULT, TILE_MODEL)}
    elif path.is_file():
        has = {name: name == path.name for name in (MODEL, RESULT, TILE_MODEL)}
        has[MODEL] |= path.suffix == ".safetensors" and not has[TILE_MODEL]
    else:
        raise InputFileError(
            f"{path}: no such folder; give what orbiflow density fit or orbiflow escherize wrote"
        )
    found = [name for name, there in has.items() if there]
    if len(found) > 1:
        raise InputFileError(
            f"{path} holds {' and '.join(found)}, of two commands: give the file that you mean"
        )
    if not found:
        raise InputFileError(
            f"{path} holds no {MODEL} and no {RESULT}: give the folder that orbiflow density fit or "
            "orbiflow escherize wrote, or that of a tile in it"
        )
    if found == [MODEL]:
        return _estimator(path)
    if found == [RESULT]:
        return _run(path, uncertified)
    return _tile_folder(path if path.is_dir() else path.parent, uncertified)


def _estimator(path: Path) -> DensityEstimator:
    file = path / MODEL if path.is_dir() else path
    density, extra = read_density(file)
    report, settings = None, {}
    beside = file.with_name(REPORT)
    document = _json(beside) if file.name == MODEL and beside.is_file() else {}
    try:
        if "settings" in document:  # a marginal or a conditional was not fitted
            report = report_from_json(document["report"])
            settings = _settings(dict(document["settings"]))
        return DensityEstimator.fitted(density, report, extra.get("columns"), **settings)
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(f"{beside}: not the report of a density: {error}") from error


def _settings(settings: dict[str, Any]) -> dict[str, Any]:
    """Of a request, as the estimator has them."""
    parts = settings.get("parts")
    own = ("repeats", "missing", "detail", "segments", "kernels", "seed")
    known = {name: settings[name] for name in own if name in settings}
    return known | {"parts": "auto" if parts is None else ",".join(parts)}


def _json(file: Path) -> dict[str, Any]:
    try:
        if file.stat().st_size > MOST_BYTES:
            raise InputFileError(f"{file}: too large for a report")
        document = json.loads(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputFileError(f"{file}: cannot be read: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        if isinstance(error, OrbiflowError):
            raise
        raise InputFileError(f"{file}: not JSON: {error}") from error
    if not isinstance(document, dict):
        raise InputFileError(
            f"{file}: not a report: {type(document).__name__} instead of an object"
        )
    return cast(dict[str, Any], document)


def _run(path: Path, uncertified: bool) -> LoadedRun:
    file, document = read_document(path)
    entries = document["tiles"]
    if not is_list(entries) or not entries:
        raise InputFileError(f"{file}: the run found no tile")
    tiles = [_tile(file, document, rank, uncertified) for rank in range(1, len(entries) + 1)]
    return LoadedRun(file.parent, tuple(tiles), document)


def _tile_folder(folder: Path, uncertified: bool) -> LoadedTile:
    result = folder.resolve().parent / RESULT
    if not result.is_file():
        raise InputFileError(
            f"{folder} holds a tile's map, and the {RESULT} with its polygon is not beside the folder: "
            f"load_saved({str(folder / TILE_MODEL)!r}) reads the map alone"
        )
    file, document = read_document(result)
    try:
        names = folder_names([str(entry["class"]) for entry in document["tiles"]])
    except (KeyError, TypeError) as error:
        raise InputFileError(f"{file}: not a result of orbiflow escherize: {error}") from error
    name = folder.resolve().name
    if name not in names:
        raise InputFileError(f"{file} tells of {', '.join(names)}, not of {name}")
    return _tile(file, document, names.index(name) + 1, uncertified)


def _tile(file: Path, document: dict[str, Any], rank: int, uncertified: bool) -> LoadedTile:
    plain = read_result(file, rank)
    certificate = certify(plain.tile)
    if not certificate.valid and not uncertified:
        raise CertificationError(
            f"{file}: tile {rank}, {plain.name}, does not tile the plane: "
            f"{'; '.join(certificate.reasons)}; load(..., uncertified=True) gives it all the same"
        )
    there = plain.model is not None and plain.model.is_file()
    saved = load_saved(plain.model) if there and plain.model is not None else None
    return LoadedTile(
        plain.tile,
        plain.y_down,
        plain.name,
        plain.rank,
        plain.model,
        certificate,
        document["tiles"][rank - 1],
        saved,
    )
