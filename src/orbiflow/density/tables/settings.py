"""Which columns and rows of a table are read: settings that the density commands share."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from orbiflow.density.data import Unit, check_unit
from orbiflow.errors import literal
from orbiflow.settings import DefaultText, Needs, SettingError, Settings

if TYPE_CHECKING:
    from orbiflow.symmetry import CrystallographicGroup

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
SPACES: tuple[str, ...] = get_args(SpaceName)


class SpaceSettings(Settings, group="Density"):
    """Where the data live."""

    space: str
    """Where the data live: torus, sphere, klein-bottle or projective-plane; unit vectors of any
    dimension on a hypersphere or in a projective-space; a rotation-space, cubic-orientations or
    hexagonal-orientations; or a group whose quotient it is: a plane group such as p4m, a flat manifold
    such as hantzsche-wendt, or a space group such as "P 21 21 21"."""

    cell: Annotated[
        tuple[float, ...] | None, DefaultText("lengths about 1 that suit the group")
    ] = None
    """Lengths and angles in degrees of the group's cell: a,b,c,alpha,beta,gamma, in the plane
    a,b,gamma. Right angles may be left out."""

    fractional: Annotated[bool, Needs("cell", because="fractions are of the lengths of a cell")] = (
        False
    )
    """The data are fractions of the cell's vectors, as in CIF, and not lengths along x, y and z."""

    linear: Annotated[tuple[str, ...], DefaultText("none")] = ()
    """Columns of a torus that are real numbers rather than angles, such as length,temperature."""

    unit: Annotated[Unit | None, DefaultText("radians, if no value is beyond 2 pi")] = None
    """Unit of angles on the torus and the Klein bottle, and of rotations in three columns."""

    def check(self) -> None:
        """Check that there is such a space, and that only angles have a unit."""
        if self.cell is not None and self.space in SPACES:
            raise SettingError(f"{{cell}} applies to groups, not to the {self.space}")
        if self.linear and self.space != "torus":
            raise SettingError(
                f"{{linear}} is for columns beside angles on a torus, not on the {self.space}"
            )
        _ = self.width  # which makes the group
        check_unit(self.space, self.unit)

    @property
    def width(self) -> int | None:
        """The number of columns that the space takes, None if there may be several."""
        if self.space in SPACES:
            return 2 if self.space == "klein-bottle" else None
        return group_of(self.space, self.cell).dim


def group_of(space: str, cell: tuple[float, ...] | None) -> CrystallographicGroup:
    """Return the group whose quotient a space is."""
    from orbiflow.symmetry import group_by_name, is_group_name

    if not is_group_name(space):
        raise SettingError(
            f"{{space}} must be {', '.join(SPACES)} or a group, such as p4m, hantzsche-wendt or "
            f"'P 21 21 21', got {literal(repr(space))}"
        )
    return group_by_name(space, cell)


class TableSettings(Settings, group="Reading the table"):
    """Which columns and rows of a table are read."""

    columns: Annotated[tuple[str, ...] | None, DefaultText("what the space takes")] = None
    """Names or numbers of the columns, such as lat,lon."""

    header: Annotated[bool | None, DefaultText("found automatically")] = None
    """Whether the table's first line names the columns."""

    drop_missing: bool = False
    """Leave out rows that lack a value."""

    missing_codes: Annotated[tuple[float, ...], DefaultText("none")] = ()
    """Numbers that stand for missing values, such as 999,-99."""

    decimal: Annotated[Literal[".", ","] | None, DefaultText("found automatically")] = None
    """Mark before the decimals of a text file; the other one then parts thousands."""


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


class CountedRowSettings(GroupedRowSettings, group="Reading the table"):
    """Which columns and rows of a table are read, how often each was seen, and how much each counts."""

    counts: str | None = None
    """Column, by name or number, that says how many rows were seen that are alike, as in a table of
    bins. Each row is taken so often."""


def check_table_name(out: Path) -> None:
    """Refuse a name for a table whose ending is that of another format."""
    if out.suffix.lower() in OTHER_FORMATS:
        raise SettingError(
            f"{{out}} must end in {', '.join(TABLES)}, got {literal(repr(out.name))}"
        )
