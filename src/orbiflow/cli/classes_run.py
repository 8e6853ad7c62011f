"""What `orbiflow classes` does."""

from __future__ import annotations

from pathlib import Path

from rich.table import Table

from orbiflow.cli.console import output
from orbiflow.errors import OutputError
from orbiflow.runtime import write_atomic
from orbiflow.symmetry import symmetry_elements
from orbiflow.tiles import (
    CLASSES,
    IsohedralClass,
    classes_png,
)

_FREEDOM = {0: "none", 1: "one axis", 2: "any"}


def run(out: Path | None) -> None:
    """Print the table; draw the classes into `out`, a PNG file, if it is given.

    Raises:
        OutputError: if it is named after another format, or cannot be written.
    """
    if out is not None and out.suffix.lower() not in ("", ".png"):
        raise OutputError(f"--out must end in .png, got {out.name!r}")
    table = Table(title="The nine isohedral classes")
    for column in (
        "class",
        "group",
        "edges",
        "identified",
        "rotation centres",
        "glides",
        "stretch",
    ):
        table.add_column(column)
    for kind in CLASSES.values():
        table.add_row(*_row(kind))
    output.print(table)
    if out is not None:
        write_atomic(out, classes_png())
        output.print(f"drawn in {out}", soft_wrap=True)


def _row(kind: IsohedralClass) -> tuple[str, ...]:
    elements = symmetry_elements(kind.group())
    orders = sorted({center.order for center in elements.centers})
    glides = {tuple(abs(glide.line.direction).round(6)) for glide in elements.lines}
    return (
        kind.name,
        kind.group_name,
        str(len(kind.template())),
        " ".join(pair.brief for pair in kind.identified_edges),
        ", ".join(f"{order}-fold" for order in orders) or "-",
        {0: "-", 1: "one direction"}.get(len(glides), "two directions"),
        _FREEDOM[kind.stretch_dim],
    )
