"""Operations on tiles: find them, export one."""

from __future__ import annotations

from dataclasses import asdict, fields
from pathlib import Path
from typing import Annotated

from orbiflow.derived.tile_settings import EscherizeSettings, ExportSettings
from orbiflow.runtime import Cancel, Note, Outcome, Progress, Sink, Written, ignore, operation
from orbiflow.settings import DefaultText, Hidden, Option


@operation("escherize", keeps_partial=True, starts_processes=True)
def escherize(
    image: Path,
    out: Annotated[Path, Option("-o")] = Path("out"),
    settings: EscherizeSettings = EscherizeSettings(),
    *,
    figures: bool = False,
    force: bool = False,
    called: Annotated[str | None, Hidden()] = None,
    on_event: Sink = ignore,
    cancel: Cancel = Cancel(),
) -> Outcome:
    """Find tiles that look like a silhouette and tile the plane, and prove it.

    Writes result.json, overview.png and index.html into the folder, and for each class a folder with
    tile.svg, tiling.svg, tiling.png, overlay.png and model.safetensors; after a search for both,
    front.png, too.

    Args:
        image: The silhouette: PNG, JPEG, WebP, SVG, or a polygon (.json, .dat).
        out: Folder for the results, made if need be.
        figures: Also write for print tiling.pdf and overlay.pdf, and of the flow field.png and
            field.pdf.
        force: Keep tiles that are not certified, marked so.
        called: What the results call the silhouette. Default: its path.
    """
    import torch

    from orbiflow.jobs.escherize import escherize as search
    from orbiflow.jobs.tile_requests import EscherizeRequest

    torch.set_num_threads(1)
    values = {
        name: value for name, value in asdict(settings).items() if name in settings.fields_given
    }
    request = EscherizeRequest(
        image=image, out=out, figures=figures, force=force, called=called, **values
    )
    finished = search(request, on_event, cancel)
    return Outcome(finished.summary, finished.state)


@operation("export")
def export(
    result: Path,
    settings: ExportSettings = ExportSettings(),
    *,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the tile")] = None,
    tile: str = "1",
    force: bool = False,
    on_event: Sink = ignore,
    cancel: Cancel = Cancel(),
) -> Outcome:
    """Write a tiling in real size: to print, to cut with a laser, to draw, to put on a page.

    Lengths are numbers with a unit: mm, cm, in or pt.

    Args:
        result: A search's folder, or its result.json.
        out: The file.
        tile: A class, such as IH4, or a rank; 1 is best.
        force: Export a tile that is not certified, marked so.
    """
    settings = settings.for_file(out)

    from orbiflow.jobs.place import check_place
    from orbiflow.runtime import write_atomic
    from orbiflow.tiles import EscherTile
    from orbiflow.tiles.exporting import writing as exporting
    from orbiflow.tiles.exporting.settings import ExportSettings as Drawn

    values = asdict(settings)
    drawn = Drawn(**{field.name: values[field.name] for field in fields(Drawn)})
    found = EscherTile.load(result, tile)
    out = out or Path(f"{found.name}.{settings.format}")
    check_place(out, result)
    on_event(Progress(0.0, "laying out"))
    scenes, notes = exporting.scenes(found, drawn, force=force)
    contents: list[str | bytes] = []
    for k, scene in enumerate(scenes):
        cancel.check()
        on_event(Progress((1 + k) / (1 + len(scenes)), "writing"))
        contents.append(exporting.write_scene(scene, drawn))
    cancel.check()
    names = exporting.sheet_names(out, len(scenes))
    files = [write_atomic(*pair) for pair in zip(names, contents, strict=True)]
    tiles = sum(len(scene.tiles) for scene in scenes)
    width, height = drawn.page
    for note in notes:
        on_event(Note(note))
    what = {"none": "tiles", "skeleton": "tiles in outline", "pieces": "pieces"}[settings.cut]
    on_event(
        Note(
            f"{tiles} {what} of {found.tile.isohedral_class}, {settings.tile_size:g} mm, on "
            f"{width:g} x {height:g} mm: written to {files[0]}"
            + (f" and {len(files) - 1} more sheets" if len(files) > 1 else "")
        )
    )
    for path in files:
        on_event(Written(path))
    return Outcome(
        {
            "files": [str(path) for path in files],
            "tiles": tiles,
            "class": found.tile.isohedral_class,
            "tile_size": settings.tile_size,
        }
    )
