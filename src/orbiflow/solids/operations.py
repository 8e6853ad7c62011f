"""The operations on solids: find those that fill space, make things of them."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from orbiflow.errors import Advice, literal
from orbiflow.runtime import (
    NEVER,
    Cancel,
    Note,
    Outcome,
    Sink,
    Table,
    Written,
    check_output_file,
    check_output_folder,
    cores,
    ignore,
    operation,
    read_json,
    write_atomic,
)
from orbiflow.settings import DefaultText, InMemory, Option
from orbiflow.solids.settings import BuildSettings, FillSettings, Painted

STOPPED = "The search was stopped."
"""What results say of a search that did not reach its end."""

if TYPE_CHECKING:
    from orbiflow.solids.run_folder import SolidSource
    from orbiflow.solids.solid import EscherSolid
else:  # what annotations mean when they are read, without heavy imports
    SolidSource = Annotated[Any, InMemory("the folder of a run, or the folder of a solid in it")]


@operation("fill", keeps_partial=True, starts_processes=True)
def fill(
    mesh: Path,
    out: Annotated[Path, Option("-o")] = Path("out"),
    settings: FillSettings = FillSettings(),
    *,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Find a solid that looks like a mesh and whose copies fill space without a gap, and prove it.

    Writes overview.png, index.html, which turns it, and solids.json; and for each solid a folder with
    tile.stl, sheet.png, stack.gif, page.html and solid.safetensors. Where it is stopped, by Ctrl-C or
    SIGTERM, it writes the solids that were found by then.

    Args:
        mesh: The mesh: STL, OBJ, PLY, 3MF, glTF or GLB, in mm.
        out: Folder for the results, made if need be.
    """
    from orbiflow.solids import run_folder, search
    from orbiflow.solids.painting import checked_painting
    from orbiflow.solids.reading import read_mesh, usual_up

    begin = time.perf_counter()
    check_output_folder(out, mesh)
    run_folder.result_folder(out)
    read = read_mesh(mesh)
    goal_size = search.usual_size(read.mesh) if settings.size is None else None
    for text in read.notes:
        on_event(Note(text))
    if goal_size is not None:
        on_event(
            Note(f"the file's size is no size to print: the longest side is made {goal_size:g} mm")
        )
    for emphasis in settings.emphasised:
        if isinstance(emphasis, Painted):
            share = f"{100 * checked_painting(read.painting).share:.2g} % of the surface"
            matters = f"matters {emphasis.weight:g} times as much as the rest"
            on_event(Note(f"what is painted, {share}, {matters}"))
    solids = search.fill(
        read.mesh,
        settings.replace(up=settings.up or usual_up(mesh)),
        name=mesh.stem,
        painting=read.painting,
        on_event=on_event,
        cancel=cancel,
    )
    stopped = cancel.cancelled
    summary = {"mesh": str(mesh), "seconds": time.perf_counter() - begin, "stopped": stopped}
    if not solids:
        on_event(Note(_nothing_found(settings, out), warning=True))
        return Outcome({**summary, "solids": []}, "nothing found")
    remark = STOPPED if stopped else ""
    if stopped:
        on_event(Note(f"{STOPPED} Solids that were found by then: {len(solids)}.", warning=True))
    # what was found is written to the end
    workers = settings.workers or cores()
    run_folder.write_run(
        solids, out, workers=workers, summary=summary, remark=remark, on_event=on_event
    )
    on_event(_table(solids))
    where = f"look at {out / run_folder.OVERVIEW} first, or open {out / run_folder.INDEX}"
    on_event(Note(f"written to {out} in {time.perf_counter() - begin:.0f} s; {where}"))
    document = read_json(out / run_folder.SOLIDS, "a run of orbiflow fill")
    summary |= {"folder": str(out), "solids": document["solids"]}
    return Outcome(summary, "cancelled" if stopped else "done")


def _nothing_found(settings: FillSettings, out: Path) -> Advice:
    """Return what to do where no body closed."""
    from orbiflow.solids import run_folder

    ways = ["another {seed}"]
    if settings.effort == "fast":
        ways = ["{effort} 'normal', which tries more places", *ways]
    ways += [f"no {{{name}}}" for name in ("separable", "groups") if getattr(settings, name)]
    earlier = f"; {literal(str(out))} still holds the solids of an earlier run"
    return Advice(
        "no solid was found that is one piece and fills space: copies grip one another's thin parts, "
        f"or cut them off; try {', or '.join(ways)}, or make thin parts thicker"
        f"{earlier if run_folder.written_files(out) else ''}"
    )


def _table(solids: list[EscherSolid]) -> Table:
    """Return a table of solids, best first."""
    rows = [
        (
            solid.group_name,
            f"{solid.likeness.overlap:.2f}",
            f"{solid.likeness.shadows:.2f}",
            f"{solid.likeness.kept:.2f}",
            f"{solid.likeness.strain:.2f}",
            " x ".join(f"{side:.0f}" for side in solid.size) + " mm",
        )
        for solid in solids
    ]
    columns = ("group", "overlap", "shadows", "kept", "bent", "size")
    return Table("Solids, best first", columns, tuple(rows))


@operation("build")
def build(
    result: SolidSource,
    out: Annotated[Path | None, Option("-o"), DefaultText("named after the solid")] = None,
    settings: BuildSettings = BuildSettings(),
    *,
    solid: Annotated[str | None, DefaultText("1, or the solid whose folder is given")] = None,
    on_event: Sink = ignore,
    cancel: Cancel = NEVER,
) -> Outcome:
    """Make things to print of a solid that fills space: one, a stack, a starting block, a puzzle.

    They lie as they are printed. Notes say how thin they are, what hangs over, and whether the pieces
    can be put together.

    Args:
        result: The folder of `orbiflow fill`, or of a solid in it.
        out: The file, .3mf or .stl.
        solid: Which one: a group, such as P21, or a rank; 1 is best.

    Raises:
        CertificationError: If the copies of the solid do not fill space.
        OrbiflowError: If the settings cannot be met.
    """
    settings = settings.for_file(out)

    from orbiflow.solids import making, run_folder

    taken = run_folder.as_solid(result, solid)
    out = out or Path(f"{taken.name}-{settings.kind}.{settings.file_format}")
    check_output_file(out, *([Path(result)] if isinstance(result, str | Path) else []))
    taken.require_certified()
    taken = taken.sized(settings.size)
    cancel.check()
    made = making.make(taken, settings)
    title = f"{settings.kind} of {taken.name} in {taken.group_name}, in mm"
    write_atomic(out, made.file(settings.file_format, title))
    for event in (*map(Note, made.notes), Written(out)):
        on_event(event)
    summary = {"file": str(out), "kind": settings.kind, "group": taken.group_name}
    return Outcome({**summary, "parts": len(made.parts), "notes": list(made.notes)})
