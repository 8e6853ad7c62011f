"""Which columns and rows of a table are read: settings that the density commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from orbiflow.errors import literal
from orbiflow.settings import DefaultText, SettingError, Settings

TABLES = (".csv", ".tsv", ".txt", ".dat")
"""What names of tables end in. Others may end in anything that is not among these:"""

# fmt: off
OTHER_FORMATS = frozenset((
    ".npy", ".npz", ".parquet", ".feather", ".arrow", ".h5", ".hdf5", ".mat", ".pkl", ".safetensors",
    ".xls", ".xlsx", ".ods", ".json", ".geojson", ".html", ".xml", ".gz", ".bz2", ".xz", ".zst", ".zip",
    ".tar", ".png", ".jpg", ".jpeg", ".gif", ".tif", ".tiff", ".webp", ".svg", ".pdf",
))
# fmt: on

SpaceName = Literal[
    "torus", "sphere", "klein-bottle", "projective-plane",
    "hypersphere", "projective-space",
    "rotation-space", "cubic-orientations", "hexagonal-orientations",
]  # fmt: skip
Unit = Literal["radians", "degrees", "turns"]


class SpaceSettings(Settings, group="Density"):
    """Where the data live."""

    space: SpaceName
    """Where the data live."""

    unit: Annotated[Unit | None, DefaultText("radians, if no value is beyond 2 pi")] = None
    """Unit of angles on the torus and the Klein bottle, and of rotations in three columns."""

    def check(self) -> None:
        """Check that only angles have a unit."""
        check_unit(self.space, self.unit)

    @property
    def width(self) -> int | None:
        """The number of columns that the space takes, None if there may be several."""
        return 2 if self.space == "klein-bottle" else None


def is_angular(space: str, columns: int) -> bool:
    """Return whether data of so many columns are angles, which have a unit."""
    rotations = ("rotation-space", "cubic-orientations", "hexagonal-orientations")
    return space in ("torus", "klein-bottle") or (space in rotations and columns == 3)


def check_unit(space: str, unit: Unit | None) -> None:
    """Refuse a unit of data that are not angles."""
    vectors = ("sphere", "projective-plane", "hypersphere", "projective-space")
    if space in vectors and unit in ("radians", "turns"):
        raise SettingError(
            f"{{unit}} {unit} applies only to angles on the torus and the Klein bottle: latitude and "
            "longitude are degrees; convert them, or give unit vectors x,y,z"
        )


class TableSettings(Settings, group="Reading the table"):
    """Which columns and rows of a table are read."""

    columns: Annotated[tuple[str, ...] | None, DefaultText("what the space takes")] = None
    """Names or numbers of the columns, such as lat,lon."""

    header: Annotated[bool | None, DefaultText("found automatically")] = None
    """Whether the table's first line names the columns."""

    drop_missing: bool = False
    """Leave out rows that lack a value."""


class RowSettings(TableSettings, group="Reading the table"):
    """Which columns and rows of a table are read, and how much each row counts."""

    missing: Literal["refuse", "drop", "marginalise"] = "refuse"
    """What is done with rows that lack a value. With marginalise, on tori, they count by the angles
    that they have."""

    weights: str | None = None
    """Column, by name or number, that says how much each row counts; only ratios matter."""

    @property
    def kept_missing(self) -> Literal["refuse", "marginalise"]:
        """What a fit does with missing values that are left."""
        return "marginalise" if self.missing == "marginalise" else "refuse"

    def check(self) -> None:
        """Check that rows that lack a value are treated in one way."""
        if self.drop_missing and self.missing == "marginalise":
            raise SettingError(
                "{drop_missing} leaves out the rows that {missing} marginalise would use; give one"
            )


class GroupedRowSettings(RowSettings, group="Reading the table"):
    """Which columns and rows of a table are read, how much each counts, and which belong together."""

    group: str | None = None
    """Column that names what rows belong to (a protein, a station, an event): those of one are not
    independent."""


def check_table_name(out: Path) -> None:
    """Refuse a name for a table whose ending is that of another format."""
    if out.suffix.lower() in OTHER_FORMATS:
        raise SettingError(
            f"{{out}} must end in {', '.join(TABLES)}, got {literal(repr(out.name))}"
        )
