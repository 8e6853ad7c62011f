"""The files of a project's density: its table, and its fits.

A fit is in the folder "fits" of its project, under the number of its task. It is complete once it has
a view.
"""

from __future__ import annotations

from pathlib import Path

from orbiflow.errors import OrbiflowError

TABLE, FIT, VIEW, SURFACE = "table.json", "model", "view.json", "surface.json"
ENDINGS = (".csv", ".tsv", ".txt", ".npy")
MAX_SHOWN = 30
"""Columns of a table that are shown, and of which a density may be."""


def table_file(home: Path) -> Path:
    """Return the table of a project, as it was uploaded."""
    found = [path for ending in ENDINGS if (path := home / f"table{ending}").is_file()]
    if not found:
        raise OrbiflowError("there is no table in this project; upload one")
    return found[0]


def ending_of(name: str) -> str:
    """Return the ending under which a table of this name is kept, or refuse it."""
    ending = Path(name).suffix.lower()
    if ending not in ENDINGS:
        raise OrbiflowError(
            f"a table's name ends in {', '.join(ENDINGS)}; save yours as CSV and give that"
        )
    return ending


def fit_folder(project: Path, number: int | None = None) -> Path:
    """Return the folder of a fit that is complete, the newest if there is no number.

    Raises:
        OrbiflowError: If there is none.
    """
    done = [int(view.parent.name) for view in project.glob(f"fits/[0-9]*/{VIEW}")]
    if number is None and done:
        number = max(done)
    if number not in done:
        raise OrbiflowError("there is no such density (any more); fit one first")
    return project / "fits" / str(number)


def map_file(fit: Path, axes: tuple[int, ...]) -> Path:
    """Return the file of a fit with the density of two of its angles on a grid."""
    return fit / f"map-{'-'.join(map(str, axes))}.json"
