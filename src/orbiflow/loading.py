"""What was saved, loaded again: `load` finds out what a folder or file holds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from orbiflow.density import (
    MODEL,
    REPORT,
    REPORTED,
    DensityEstimator,
    FitReport,
    density_to_bytes,
    read_density,
    written_files,
)
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError
from orbiflow.runtime import (
    ResultFolder,
    from_json,
    is_list,
    read_json,
    to_json,
    write_atomic,
    write_json,
)
from orbiflow.settings import as_path
from orbiflow.solids import SOLID, SOLIDS, EscherSolid, read_run, read_solid
from orbiflow.tiles import (
    RESULT,
    TILE_MODEL,
    EscherTile,
    TileMap,
    read_document,
    read_result,
    save_tiles,
)


@dataclass(frozen=True, eq=False)
class LoadedRun:
    """The folder of `orbiflow escherize`: its tiles, best first, and its result.json."""

    folder: Path
    tiles: tuple[EscherTile, ...]
    document: dict[str, Any]

    @property
    def best(self) -> EscherTile:
        """The best tile."""
        return self.tiles[0]

    def __len__(self) -> int:
        return len(self.tiles)

    def __iter__(self) -> Iterator[EscherTile]:
        return iter(self.tiles)

    def __getitem__(self, which: str | int) -> EscherTile:
        """Return a tile by class, such as "IH4" (its best tile), or by rank from 1."""
        for tile in self.tiles:
            if which in (tile.isohedral_class, tile.rank):
                return tile
        names = ", ".join(dict.fromkeys(tile.isohedral_class for tile in self.tiles))
        raise OrbiflowError(
            f"{self.folder} holds no tile {which!r}; there are {names}, and ranks 1 to {len(self)}"
        )


Loaded: TypeAlias = (
    DensityEstimator | LoadedRun | EscherTile | TileMap | EscherSolid | list[EscherSolid]
)


def load(path: str | Path, *, uncertified: bool = False) -> Loaded:
    """Return what was saved in a folder or file.

    - a folder of `orbiflow density fit`, or its density.safetensors: the fitted `DensityEstimator`,
      with `report_` and `feature_names_in_`;
    - a folder of `orbiflow escherize`, or its result.json: a `LoadedRun`, whose tiles are certified
      anew;
    - the folder of one of its tiles, such as `out/turtle/IH4`: the `EscherTile`;
    - a tile's model.safetensors without the run around it: its maps, a `TileMap`;
    - a folder of `orbiflow fill`, or its solids.json: a list of `EscherSolid`, best first;
    - the folder of one of its solids, or its solid.safetensors: the `EscherSolid`.

    Args:
        path: The folder or file.
        uncertified: Return tiles and solids that do not fit together, too; their `certificate` says
            what is wrong.

    Raises:
        InputFileError: if nothing is there, a folder holds neither or both, or a file is damaged.
        CertificationError: for a tile that does not tile, unless it may be uncertified.
    """
    path = as_path(path, "the folder")
    names = (MODEL, RESULT, TILE_MODEL, SOLIDS, SOLID)
    if path.is_dir():
        has = {name: (path / name).is_file() for name in names}
    elif path.is_file():
        has = {name: name == path.name for name in names}
        has[MODEL] |= path.suffix == ".safetensors" and not has[TILE_MODEL] | has[SOLID]
    else:
        raise InputFileError(
            f"{path}: no such folder; give what orbiflow density fit or orbiflow escherize wrote"
        )
    present = [name for name, there in has.items() if there]
    if len(present) > 1:
        raise InputFileError(
            f"{path} holds {' and '.join(present)}, of two commands: give the file that you mean"
        )
    if not present:
        raise InputFileError(
            f"{path} holds no {MODEL} and no {RESULT}: give the folder that orbiflow density fit or "
            "orbiflow escherize wrote, or that of a tile in it"
        )
    if present in ([SOLIDS], [SOLID]):
        return _solids(path, present[0], uncertified)
    if present == [MODEL]:
        return _estimator(path)
    if present == [RESULT]:
        return _run(path, uncertified)
    return _tile_folder(path if path.is_dir() else path.parent, uncertified)


def save(
    what: EscherTile | Sequence[EscherTile] | LoadedRun | DensityEstimator, path: str | Path
) -> Path:
    """Save tiles or a fitted density so that `load` returns them again.

    Args:
        what: A tile, tiles of one search, best first, or a fitted `DensityEstimator`, of which its
            density, unit, columns' names, settings and the report of its fit are kept.
        path: The folder to write; for an estimator also a file that ends in .safetensors, which holds
            all but settings and report.

    Raises:
        OrbiflowError: for an estimator that was not fitted, or a density that files do not hold.
        OutputError: if the folder holds anything else, or cannot be written.
    """
    if isinstance(what, DensityEstimator):
        return _save_estimator(what, as_path(path, "the folder to write into"))
    return save_tiles([what] if isinstance(what, EscherTile) else list(what), path)


def _save_estimator(estimator: DensityEstimator, path: Path) -> Path:
    if not hasattr(estimator, "density_"):
        raise OrbiflowError("the estimator was not fitted, so there is nothing to save: call fit")
    columns = [str(name) for name in getattr(estimator, "feature_names_in_", ())]
    content = density_to_bytes(estimator.density_, columns=columns)
    if path.suffix == ".safetensors":
        return write_atomic(path, content)
    space, report = estimator.space_, getattr(estimator, "report_", None)
    document: dict[str, Any] = {
        "space": {"name": space.name, **space.settings()},
        "columns": columns,
        "report": {"error": estimator.density_.error} if report is None else to_json(report),
    }
    if report is not None:
        document["settings"] = {name: getattr(estimator, name) for name in REPORTED}
    folder = ResultFolder(path, written_files)
    with folder.replaced() as staged:
        write_atomic(staged / MODEL, content)
        write_json(staged / REPORT, document)
    return folder.path


def _estimator(path: Path) -> DensityEstimator:
    file = path / MODEL if path.is_dir() else path
    density, extra = read_density(file)
    report, settings = None, {}
    beside = file.with_name(REPORT)
    document = read_json(beside, "a report") if file.name == MODEL and beside.is_file() else {}
    try:
        if "settings" in document:  # a marginal or a conditional was not fitted
            report = from_json(FitReport, document["report"], "report")
            stored = dict(document["settings"])
            settings = {name: stored[name] for name in REPORTED if name in stored}
        if unit := density.space.settings().get("unit"):
            settings["unit"] = unit
        return DensityEstimator.fitted(density, report, extra.get("columns"), **settings)
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(f"{beside}: not the report of a density: {error}") from error


def _solids(path: Path, name: str, uncertified: bool) -> EscherSolid | list[EscherSolid]:
    solids = read_run(path) if name == SOLIDS else [read_solid(path)]
    for solid in [] if uncertified else solids:
        solid.require_certified()
    return solids if name == SOLIDS else solids[0]


def _run(path: Path, uncertified: bool) -> LoadedRun:
    file, document = read_document(path)
    entries = document["tiles"]
    if not is_list(entries) or not entries:
        raise InputFileError(f"{file}: the run found no tile")
    tiles = [_tile(file, rank, uncertified) for rank in range(1, len(entries) + 1)]
    return LoadedRun(file.parent, tuple(tiles), document)


def _tile_folder(folder: Path, uncertified: bool) -> EscherTile | TileMap:
    if not (folder.resolve().parent / RESULT).is_file():
        return TileMap.read(folder / TILE_MODEL)
    return _tile(folder, None, uncertified)


def _tile(path: Path, rank: int | None, uncertified: bool) -> EscherTile:
    tile = read_result(path, rank)
    if not tile.certificate.valid and not uncertified:
        raise CertificationError(
            f"{path}: tile {tile.rank}, {tile.name}, does not tile the plane: "
            f"{'; '.join(tile.certificate.reasons)}; load(..., uncertified=True) gives it all the same"
        )
    return tile
