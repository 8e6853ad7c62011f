"""`result.json`: the tiles of a run, written and read (schema: docs/result.schema.json)."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError, SettingError
from orbiflow.runtime import (
    ResultFolder,
    is_list,
    is_object,
    make_folder,
    read_json,
    write_atomic,
    write_json,
)
from orbiflow.settings import as_instance, as_path, described
from orbiflow.symmetry import CrystallographicGroup, Isometry, checked_lattice
from orbiflow.tiles.geometry import Place
from orbiflow.tiles.likeness import (
    Fidelity,
    Likeness,
    Rating,
    Recognisability,
    ShapeMetrics,
    Thinnest,
)
from orbiflow.tiles.tile import NO_MAP, EscherTile, Part, SearchFacts, TileSource
from orbiflow.tiles.tilings import ISOHEDRAL_TYPES, Tile, isohedral_class

RESULT, TILE_MODEL = "result.json", "model.safetensors"
SCHEMA_VERSION = 2
PICTURES = (".png", ".jpg", ".jpeg", ".webp", ".gif", ".svg", ".pdf")
SAME_AREA = 1e-6  # the relative difference below which areas are the same
MOST_NAMED = 5  # runs that a message names


def read_result(path: str | Path, which: str | int | None = None) -> EscherTile:
    """Return a tile of a run.

    Args:
        path: The run's folder, its result.json, or the folder of one of its tiles.
        which: A class, such as "IH4" (its best tile), or a rank from 1, the best. Default: the tile
            whose folder is given, otherwise the best.

    Raises:
        InputFileError: if there is no such file, it is none of orbiflow's, or holds no such tile.
    """
    file, document = read_document(path)
    names, source, silhouette = _contents(file, document)
    index = _index(names, 1 if which is None else which, file)
    folder = Path(path).resolve()
    if folder.is_dir() and folder != file.parent.resolve():  # a tile's own
        folders = folder_names(names)
        if folder.name not in folders:
            raise InputFileError(f"{file} tells of {', '.join(folders)}, not of {folder.name}")
        if which is not None and folders[index] != folder.name:
            raise InputFileError(
                f"{path} is one tile's folder, and tile {which} another: give {file.parent} for that"
            )
        index = folders.index(folder.name)
    entry = document["tiles"][index]
    try:
        tile = _tile(entry)
        # folders are named after classes: an unknown name leads nowhere
        tile_folder = file.parent / folder_names(names)[index] if tile.isohedral_class else None
        read = _measured(tile, entry, f"{source}-{names[index]}", silhouette, tile_folder)
        read = read.changed(
            rank=index + 1,
            search=SearchFacts(**{name: entry[name] for name in _SEARCH if name in entry}),
        )
        if parts := entry.get("parts", []):
            read = _divided(read, parts, tile_folder)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise InputFileError(f"{file}: tile {index + 1} cannot be read: {error}") from error
    return read


def read_tiles(path: str | Path) -> list[EscherTile]:
    """Return the best tile of each class of a run, the best first; of a tile's folder that tile alone.

    Raises:
        InputFileError: As `read_result`.
    """
    file, document = read_document(path)
    names, folder = _contents(file, document)[0], Path(path).resolve()
    if folder.is_dir() and folder != file.parent.resolve():
        return [read_result(path)]
    return [read_result(path, 1 + names.index(name)) for name in dict.fromkeys(names)]


def _measured(
    tile: Tile,
    entry: dict[str, Any],
    name: str,
    silhouette: dict[str, Any],
    folder: Path | None,
    number: int = 0,
) -> EscherTile:
    """Return a tile, or one of its figures, with what an entry says of it."""
    return EscherTile(
        tile,
        name=name,
        y_down=bool(silhouette["y_down"]),
        silhouette=silhouette,
        map_source=None if folder is None else folder / part_file(TILE_MODEL, number),
        likeness=_likeness(entry),
        rating=Rating(entry["rating"]["stars"]) if entry.get("rating") else None,
    )


def _divided(whole: EscherTile, entries: list[dict[str, Any]], folder: Path | None) -> EscherTile:
    """Return a tile that figures divide."""
    parts = tuple(_part(whole, entry, folder, k) for k, entry in enumerate(entries))
    divided = whole.changed(division=parts, map_source=None, no_map=NO_MAP)
    area, whole_area = (
        sum(prototile.signed_area for prototile in divided.tiling.prototiles),
        divided.tile.signed_area,
    )
    if not abs(area - whole_area) <= SAME_AREA * abs(whole_area):
        raise OrbiflowError("its parts do not fill its polygon")
    return divided


def _part(whole: EscherTile, entry: dict[str, Any], folder: Path | None, number: int) -> Part:
    """Return one of the figures that divide a tile."""
    place = Place(*(np.array(entry["place"][name], float) for name in ("linear", "offset")))
    if place.linear.shape != (2, 2) or place.offset.shape != (2,) or not place.scale > 0:
        raise OrbiflowError("the place of a part must be a similarity: linear (2, 2), offset (2,)")
    group = whole.tile.group.conjugate(*place.inverse)
    tile = Tile(_ring(entry), group, corners=tuple(entry["corners"]))
    if entry["input"] is None:
        return Part.background(tile, y_down=whole.y_down)
    figure = _measured(tile, entry, str(entry["name"]), entry["input"], folder, number)
    return Part(figure.changed(rank=whole.rank), place)


def as_tile(source: TileSource, which: str | int | None = None) -> EscherTile:
    """Return the finished tile that is meant; of a run's folder `which`, or the best one.

    Raises:
        OrbiflowError: For what holds no tile.
        InputFileError: As `read_result`.
    """
    if which is not None and not isinstance(source, str | Path):
        raise SettingError(
            "{tile} chooses among the tiles of a folder; leave it out for a tile in memory"
        )
    if isinstance(source, EscherTile):
        return source
    if isinstance(source, str | Path):
        return read_result(source, which)
    return EscherTile(as_instance(source, Tile, "the tile", "read_result(folder) gives one"))


def _contents(file: Path, document: dict[str, Any]) -> tuple[list[str], str, dict[str, Any]]:
    """Return the classes of a run's tiles, and the silhouette's name and report."""
    try:
        names = [str(entry["class"]) for entry in document["tiles"]]
        silhouette = document["input"]
        _ = silhouette["y_down"]
        return names, Path(str(silhouette["source"])).stem, silhouette
    except (KeyError, TypeError) as error:
        missing = f"it lacks {error}" if isinstance(error, KeyError) else str(error)
        raise InputFileError(f"{file}: not a result of orbiflow escherize: {missing}") from error


def part_file(name: str, number: int) -> str:
    """Return the name of the file of a figure, counted from 0, among those of a tile.

    >>> part_file("model.safetensors", 0), part_file("overlay.png", 1)
    ('model.safetensors', 'overlay-2.png')
    """
    stem, dot, ending = name.rpartition(".")
    return name if number == 0 else f"{stem}-{number + 1}{dot}{ending}"


def folder_names(classes: Iterable[str]) -> list[str]:
    """Return a folder's name for each tile of these classes; a class's second is IH4-2 and so on.

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
    """Return the result.json at a path, in a run's folder or above a tile's, and what it holds."""
    source = as_path(path, "the result")
    file = _result_in(source) if source.is_dir() else source
    if not file.exists():
        what = f"{source}: no such file or folder; give what orbiflow escherize wrote"
        raise InputFileError(what)
    first = f"find its tiles first: orbiflow escherize {file}"
    if file.suffix.lower() in PICTURES:
        raise InputFileError(f"{file}: a picture, and not a result; {first}")
    try:
        document = read_json(file, "a result of orbiflow escherize")
        if "tiles" not in document:
            raise InputFileError(f"{file}: not a result of orbiflow escherize: it names no tiles")
    except InputFileError as error:
        if file.name == RESULT:
            raise
        raise InputFileError(f"{error}; if it is a silhouette, {first}") from error
    layout = document.get("schema_version", SCHEMA_VERSION)
    if layout != SCHEMA_VERSION:
        raise InputFileError(
            f"{file}: schema_version must be {SCHEMA_VERSION}, got {described(layout)}; if a newer "
            "orbiflow wrote the file, update this one, otherwise search again"
        )
    return file, document


def _result_in(folder: Path) -> Path:
    """Return the result.json of a run's folder, or of the run that a tile's folder belongs to."""
    here, above = folder / RESULT, folder.resolve().parent / RESULT
    runs = [] if here.exists() else sorted(file.parent.name for file in folder.glob(f"*/{RESULT}"))
    if runs:
        some = ", ".join(runs[:MOST_NAMED]) + ", ..." * (len(runs) > MOST_NAMED)
        raise InputFileError(
            f"{folder} holds the runs {some}: give one, such as {folder / runs[0]}"
        )
    if not here.exists() and not above.exists():
        what = f"{folder} holds no {RESULT}; give the folder that orbiflow escherize wrote"
        raise InputFileError(what)
    return here if here.exists() else above


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


def save_tiles(tiles: Sequence[EscherTile], folder: str | Path) -> Path:
    """Write tiles, best first, as a run's folder: a result.json, and each one's map in its own folder.

    Tiles that were saved there before are replaced. Returns the folder.

    Raises:
        OrbiflowError: without any tile.
        OutputError: if the folder holds anything else, or cannot be written.
    """
    if not tiles:
        raise OrbiflowError("there is no tile to save")
    run = ResultFolder(as_path(folder, "the folder to write into"), _saved_files)
    names = folder_names(tile.isohedral_class or "tile" for tile in tiles)
    silhouette = tiles[0].silhouette or {"source": tiles[0].name, "y_down": tiles[0].y_down}
    document = {
        "schema_version": SCHEMA_VERSION,
        "input": silhouette,
        "tiles": [tile_json(tile) for tile in tiles],
    }
    with run.replaced() as staged:
        for tile, name in zip(tiles, names, strict=True):
            for number, part in enumerate(tile.figures):
                if part.figure.map is not None:
                    file = make_folder(staged / name) / part_file(TILE_MODEL, number)
                    write_atomic(file, part.figure.map.to_bytes())
        write_json(staged / RESULT, document)
    return run.path


def _saved_files(folder: Path) -> set[str]:
    """Return the files that `save_tiles` wrote into a folder, relative to it."""
    try:
        entries = read_document(folder / RESULT)[1]["tiles"]
        names = folder_names([entry["class"] or "tile" for entry in entries])
        counts = [max(1, len(entry.get("parts", ()))) for entry in entries]
    except (OrbiflowError, KeyError, TypeError):
        return set()
    models = (
        f"{name}/{part_file(TILE_MODEL, number)}"
        for name, count in zip(names, counts, strict=True)
        for number in range(count)
    )
    return {RESULT, *models}


def group_json(group: CrystallographicGroup) -> dict[str, Any]:
    """Return the lattice (basis vectors as columns) and coset representatives as nested lists."""
    return {
        "name": group.name,
        "lattice": group.lattice.tolist(),
        "cosets": [
            {"linear": g.linear.tolist(), "translation": g.translation.tolist()}
            for g in group.cosets
        ],
    }


def tile_json(tile: EscherTile) -> dict[str, Any]:
    """Return one entry of `tiles`: polygon and group in the input's own coordinates."""
    search = tile.search
    # what is measured of a tile that figures divide is theirs
    measures = (
        {"parts": [_part_json(part) for part in tile.figures]}
        if len(tile.figures) > 1
        else _measures_json(tile)
    )
    return {
        "class": tile.isohedral_class,
        "arrangement": tile.arrangement,
        "objective": search.objective,
        **_rating_json(tile),
        **measures,
        "certificate": tile.certificate.as_dict(),
        "group": group_json(tile.tile.group),
        "starts": search.starts,
        "dropped": search.dropped,
        "seconds": round(search.seconds, 3),
    }


def _rating_json(tile: EscherTile) -> dict[str, Any]:
    """Return how good a tile or a figure is, and its polygon in its own coordinates."""
    rating = tile.rating
    return {
        "rating": rating and {"stars": rating.stars, "word": rating.word},
        "score": _or_none(tile.score),
        "polygon": _closed(tile.tile.polygon),
        "corners": list(tile.tile.corners),
    }


def _measures_json(tile: EscherTile) -> dict[str, Any]:
    """Return what is measured of a tile, or one of its figures, in its own coordinates."""
    likeness, thin = tile.likeness, tile.likeness.thinnest
    return {
        "smoothed": likeness.smoothed,
        "metrics": {
            **_or_none(likeness.metrics.as_dict()),
            "deformation": likeness.deformation,
            "bent_iou": likeness.bent_iou,
            "pinned": likeness.pinned,
            "fidelity": None if likeness.fidelity is None else asdict(likeness.fidelity),
        },
        "recognisability": _or_none(likeness.recognisability.as_dict()),
        "bent": None if likeness.bent is None else _closed(likeness.bent),
        "thinnest": thin if thin is None else {**thin._asdict(), "ends": thin.ends.tolist()},
    }


def _part_json(part: Part) -> dict[str, Any]:
    """Return what is known of one of the figures that divide a tile."""
    place = {"linear": part.place.linear.tolist(), "offset": part.place.offset.tolist()}
    facts = {"name": part.figure.name, "input": part.figure.silhouette, "place": place}
    measured = {} if part.is_background else _measures_json(part.figure)
    return {**facts, **_rating_json(part.figure), **measured}


def _or_none(value: Any) -> Any:
    """Return the value with None for NaN, which JSON has not."""
    if is_object(value):
        return {name: _or_none(part) for name, part in value.items()}
    if is_list(value):
        return [_or_none(part) for part in value]
    return None if isinstance(value, float) and math.isnan(value) else value


def _closed(ring: Array) -> list[list[float]]:
    return np.concatenate([ring, ring[:1]]).tolist()


def _likeness(entry: dict[str, Any]) -> Likeness:
    """Return the measures that an entry states; those that it lacks are left out."""
    metrics = dict(entry.get("metrics") or {})
    plain = ("deformation", "bent_iou", "pinned")
    measures: dict[str, Any] = {name: metrics.pop(name, None) for name in plain}
    fidelity = metrics.pop("fidelity", None)
    if fidelity is not None:
        measures["fidelity"] = Fidelity(**{**fidelity, "pieces": tuple(fidelity["pieces"])})
    if metrics.get("iou") is not None:
        measures["metrics"] = ShapeMetrics(**{**metrics, "window": tuple(metrics["window"])})
    recognised = entry.get("recognisability")
    if recognised and recognised["score"] is not None:
        measures["recognisability"] = Recognisability(**recognised)
    thinnest, bent = entry.get("thinnest"), entry.get("bent")
    if thinnest is not None:
        ends = np.array(thinnest["ends"], dtype=np.float64)
        measures["thinnest"] = Thinnest(thinnest["width"], thinnest["share"], ends)
    if bent is not None:
        measures["bent"] = np.array(bent, dtype=np.float64)[:-1]
    return Likeness(known_score=entry.get("score"), smoothed=entry.get("smoothed", 0.0), **measures)


_SEARCH = ("objective", "starts", "dropped", "seconds")  # fields of `SearchFacts` in an entry


def _tile(entry: dict[str, Any]) -> Tile:
    group = entry["group"]
    cosets = tuple(
        Isometry(np.array(coset["linear"]), np.array(coset["translation"]))
        for coset in group["cosets"]
    )
    if not cosets:
        raise OrbiflowError("its group has no cosets")
    name = str(entry["class"])
    return Tile(
        _ring(entry),
        CrystallographicGroup(checked_lattice(group["lattice"]), cosets, str(group["name"])),
        name if name in ISOHEDRAL_TYPES else "",
        tuple(entry["corners"]),
    )


def _ring(entry: dict[str, Any]) -> Array:
    """Return the polygon (N, 2) of an entry."""
    ring = np.array(entry["polygon"], dtype=np.float64)
    if ring.ndim != 2 or ring.shape[1] != 2 or len(ring) < 4:
        raise OrbiflowError(f"its polygon should be a closed ring of points, got {ring.shape}")
    return ring[:-1]
