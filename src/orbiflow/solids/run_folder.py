"""The folder of a search for solids: a folder for each, an overview, and solids.json."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from orbiflow.drawing import png_bytes, write_stl
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import (
    NEVER,
    Cancel,
    ResultFolder,
    Sink,
    Team,
    Written,
    ignore,
    read_json,
    write_atomic,
    write_json,
)
from orbiflow.solids.bodies import as_body
from orbiflow.solids.pictures import solid_gif, solid_sheet
from orbiflow.solids.solid import SOLID, EscherSolid, read_solid
from orbiflow.solids.web_page import stack_page

SOLIDS = "solids.json"
"""The file that lists the solids of a run, best first."""

OVERVIEW, INDEX = "overview.png", "index.html"
SOLID_FILES = (SOLID, "tile.stl", "sheet.png", "stack.gif", "page.html")
"""The files in each solid's folder."""

SCHEMA_VERSION = 1
SHEET_WIDTH, FRAMES = 1600, 36  # of a sheet in pixels, and of a GIF
SEARCHED = 0.9  # share of the whole work when solids are found and only pictures are missing


def result_folder(out: Path) -> ResultFolder:
    """Return the folder that a run is written to, which holds nothing else."""
    return ResultFolder(out, written_files)


def folder_name(rank: int, solid: EscherSolid) -> str:
    """Return the name of a solid's folder: its rank and its group.

    >>> from types import SimpleNamespace
    >>> folder_name(1, SimpleNamespace(group_name="P 1 21/c 1"))
    '1-P121_c1'
    """
    short = solid.group_name.replace(" ", "")
    return f"{rank}-" + "".join(c if c.isalnum() or c == "-" else "_" for c in short)


def written_files(folder: Path) -> set[str]:
    """Return the paths of the files that an earlier search wrote into a folder, by its solids.json.

    They are relative, with slashes; there are none if there is no such run.
    """
    try:
        document = json.loads((folder / SOLIDS).read_text(encoding="utf-8"))
        names = [str(entry["folder"]) for entry in document["solids"]]
        ours = isinstance(document["schema_version"], int)
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        ours, names = False, []
    if not ours:
        return set()
    return {SOLIDS, OVERVIEW, INDEX} | {f"{name}/{file}" for name in names for file in SOLID_FILES}


def measures(rank: int, solid: EscherSolid) -> dict[str, Any]:
    """Return what solids.json says of a solid."""
    proof, leaving = solid.certificate, solid.leaving
    return {
        "folder": folder_name(rank, solid),
        "group": solid.group_name,
        "number_of_cosets": solid.group.order,
        **solid.likeness.as_dict(),
        "size": solid.size.tolist(),
        "volume": solid.volume,
        "certified": proof.valid,
        "triangles": proof.faces,
        "pair_error": proof.pair_error,
        "overlap_with_copies": proof.overlap,
        "uncovered": proof.gap,
        "leaves": leaving.is_free,
        "leaves_along": leaving.direction.tolist(),
        "blocked": leaving.blocked,
        "seconds": solid.seconds,
    }


def write_run(
    solids: Sequence[EscherSolid],
    out: Path,
    *,
    workers: int = 1,
    summary: dict[str, Any] | None = None,
    remark: str = "",
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> list[Path]:
    """Write solids, best first, into a folder; return its files.

    Args:
        solids: The solids.
        out: The folder.
        workers: Processes that draw them.
        summary: What solids.json says beside them.
        remark: A sentence on the search for overview and page.
        on_event: Called with `Progress` and `Written`.
        cancel: Checked before each solid.

    Raises:
        OutputError: If the folder holds anything else, or cannot be written.
        Cancelled: If the token was cancelled; nothing is then written.
    """
    folder = result_folder(out)
    team = Team(__name__, workers, on_event, cancel, SEARCHED)
    made = team.each(_measured_and_drawn, list(enumerate(solids, 1)), "drawing", 1.0)
    entries = [entry for entry, _ in made]
    files = {
        f"{entry['folder']}/{name}": content
        for entry, contents in made
        for name, content in contents.items()
    }
    files |= _first_looks(solids[0], made[0][1], remark)
    with folder.replaced() as staged:
        for entry in entries:
            (staged / entry["folder"]).mkdir()
        for name, content in files.items():
            write_atomic(staged / name, content)
        document = {"schema_version": SCHEMA_VERSION, **(summary or {}), "solids": entries}
        write_json(staged / SOLIDS, document)
    paths = [folder.path / name for name in (*files, SOLIDS)]
    for path in paths:
        on_event(Written(path))
    return paths


def _measured_and_drawn(job: tuple[int, EscherSolid]) -> tuple[dict[str, Any], dict[str, bytes]]:
    """Return what solids.json says of a solid of a rank, and its files."""
    return measures(*job), solid_files(job[1])


def _first_looks(best: EscherSolid, files: dict[str, bytes], remark: str) -> dict[str, bytes]:
    """Return the overview and the page of a run, which show its best solid and perhaps a remark."""
    if not remark:
        return {OVERVIEW: files["sheet.png"], INDEX: files["page.html"]}
    sheet = solid_sheet(best, width=SHEET_WIDTH, remark=remark)
    page = stack_page(best, title=title_of(best), remark=remark)
    return {OVERVIEW: png_bytes(sheet), INDEX: page.encode()}


def title_of(solid: EscherSolid) -> str:
    """Return what a solid is of, and its group."""
    return f"{solid.name}, {solid.group_name}"


def solid_files(solid: EscherSolid) -> dict[str, bytes]:
    """Return the content of each of the `SOLID_FILES` of a solid."""
    title = title_of(solid)
    scaled = solid.tile.moved(solid.millimetres * np.eye(3))
    return {
        SOLID: solid.to_bytes(),
        "tile.stl": write_stl({"tile": as_body(scaled)}, f"{title}, in mm"),
        "sheet.png": png_bytes(solid_sheet(solid, width=SHEET_WIDTH)),
        "stack.gif": solid_gif(solid, size=400, frames=FRAMES),
        "page.html": stack_page(solid, title=title).encode(),
    }


def read_run(path: str | Path) -> list[EscherSolid]:
    """Return the solids of a run's folder, best first.

    Raises `InputFileError` if it holds none, or a file is damaged.
    """
    path = Path(path)
    file = path / SOLIDS if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        raise InputFileError(f"{path} holds no {SOLIDS}; give the folder that orbiflow fill wrote")
    document = read_json(file, "a run of orbiflow fill")
    try:
        names = [str(entry["folder"]) for entry in document["solids"]]
    except (KeyError, TypeError) as error:
        raise InputFileError(f"{file}: it lists no solids ({error})") from error
    if any(Path(name).name != name for name in names):
        raise InputFileError(f"{file}: the folders of solids must be inside its own")
    return [read_solid(file.parent / name) for name in names]


SolidSource: TypeAlias = EscherSolid | str | Path
"""A solid in memory, the folder of a run, or of a solid in it."""


def as_solid(source: SolidSource, which: str | None = None) -> EscherSolid:
    """Return a solid: one in memory, or of a run's folder, by rank or group; 1 is the best.

    Raises:
        InputFileError: If nothing is there.
        OrbiflowError: If the run has no such solid.
    """
    if isinstance(source, EscherSolid):
        return source
    path = Path(source)
    if (path / SOLID).is_file() or path.suffix == ".safetensors":
        return read_solid(path)
    solids = read_run(path)
    for rank, solid in enumerate(solids, 1):
        short = solid.group_name.replace(" ", "")
        if which is None or which.strip() in (str(rank), solid.group_name, short):
            return solid
    names = ", ".join(solid.group_name for solid in solids)
    raise OrbiflowError(
        f"{path} holds no solid {which!r}; there are {names}, and ranks 1 to {len(solids)}"
    )
