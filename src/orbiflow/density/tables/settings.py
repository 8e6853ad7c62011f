"""Which columns and rows of a table are read: settings that the density commands share."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from orbiflow.density.data import ROTATIONS, Unit, check_unit, rotation_form
from orbiflow.errors import SettingError, literal
from orbiflow.settings import DefaultText, Needs, Settings

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
    "rotation-space",
]  # fmt: skip
SPACES: tuple[str, ...] = get_args(SpaceName)

RotationForm = Literal[
    "bunge", "vector", "rodrigues", "quaternion", "scalar-first", "matrix",
    "ZXZ", "ZYZ", "XYZ", "ZYX", "xyz", "zyx",
]  # fmt: skip


class SpaceSettings(Settings, group="Density"):
    """Where the data live."""

    space: str = "torus"
    """Where the data live: torus, which is any columns that have roles; sphere, klein-bottle or
    projective-plane; unit vectors of any dimension on a hypersphere or in a projective-space; a
    rotation-space; or a group whose quotient it is: a plane group such as p4m, a flat manifold such as
    hantzsche-wendt, or a space group such as "P 21 21 21"."""

    cell: Annotated[
        tuple[float, ...] | None, DefaultText("lengths about 1 that suit the group")
    ] = None
    """Lengths and angles in degrees of the group's cell: a,b,c,alpha,beta,gamma, in the plane
    a,b,gamma. Right angles may be left out."""

    fractional: Annotated[bool, Needs("cell", because="fractions are of the lengths of a cell")] = (
        False
    )
    """The data are fractions of the cell's vectors, as in CIF, and not lengths along x, y and z."""

    unit: Annotated[Unit | None, DefaultText("what the columns say")] = None
    """Unit of angles whose columns name none. On the sphere, degrees says that small ones are no
    radians."""

    crystal: Annotated[str | None, DefaultText("none")] = None
    """Symmetry of the crystals whose orientations a rotation-space has: a point group or Laue class
    such as 432, m-3m or 6/mmm, or a system such as cubic. Of a group with reflections, the rotations of
    its Laue class count."""

    specimen: Annotated[str | None, DefaultText("none")] = None
    """Symmetry of the specimen in which they are, such as 222 or orthotropic."""

    form: Annotated[RotationForm | None, DefaultText("what the columns' names say")] = None
    """How columns write rotations: Bunge's angles phi1, Phi, phi2; a vector (axis times angle) or
    Rodrigues' vector; a quaternion with its scalar last or scalar-first; a matrix, row by row; or Euler
    angles about the axes named, which turn along if they are capitals."""

    passive: bool = False
    """The columns write the inverse rotations, from the specimen's coordinates to the crystal's."""

    def check(self) -> None:
        """Check that there is such a space, and that only angles have a unit."""
        if self.cell is not None and self.space in SPACES:
            raise SettingError(f"{{cell}} applies to groups, not to the {self.space}")
        self._check_rotations()
        _ = self.width  # which makes the group
        check_unit(self.space, self.unit)

    def _check_rotations(self) -> None:
        """Check that what is of rotations is asked of rotations, and that there are such symmetries."""
        options = {name: getattr(self, name) for name in ("crystal", "specimen", "form", "passive")}
        chosen = [name for name, value in options.items() if value]
        if not chosen:
            return
        if self.space != ROTATIONS:
            raise SettingError(
                f"{{{chosen[0]}}} is for rotations, not for the {literal(self.space)}: take {{space}} "
                "rotation-space"
            )
        from orbiflow.density.spaces import make_space

        symmetry = {"symmetry": self.crystal, "specimen": self.specimen, "passive": self.passive}
        try:
            make_space(self.space, form=self.form or "quaternion", **symmetry)
        except SettingError as error:
            raise SettingError(error.template.replace("{symmetry}", "{crystal}")) from error

    def rotation_form(self, names: Sequence[str]) -> str | None:
        """Return how columns of these names write rotations; None of no rotations.

        Three columns without names are Bunge's angles if there are crystals, else a vector.
        """
        if self.space != ROTATIONS:
            return None
        width, form = len(names), "ZXZ" if self.form == "bunge" else self.form
        default = {3: "vector" if self.crystal is None else "ZXZ", 9: "matrix"}.get(
            width, "quaternion"
        )
        return rotation_form(self.space, names, width, form) or default

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

    columns: Annotated[tuple[str, ...] | None, DefaultText("what their names say")] = None
    """Columns, by name or number, and what they are: dir=angle:degrees,speed=positive. A role is
    angle:UNIT, axial:UNIT, cycle:PERIOD, linear, positive, bounded:LOW:HIGH, weight, count, group or
    ignore; docs/columns.md has the roles of names. Those of a space are named in its order: lat,lon."""

    header: Annotated[bool | None, DefaultText("found automatically")] = None
    """Whether the table's first line names the columns."""

    where: Annotated[tuple[str, ...], DefaultText("all rows")] = ()
    """Rows to read, by values of other columns, such as phase=1,site=north. Of values of one column, a
    row must have one, of several columns one in each."""

    drop_missing: bool = False
    """Leave out rows that lack a value."""

    missing_codes: Annotated[tuple[str, ...], DefaultText("none")] = ()
    """What stands for missing values in any column, such as 999,-99,VRB."""

    decimal: Annotated[Literal[".", ","], DefaultText(".")] = "."
    """Mark before the decimals of a text file."""


class RowSettings(TableSettings, group="Reading the table"):
    """Which columns and rows of a table are read, and what is done with rows that lack a value."""

    missing: Literal["refuse", "drop", "marginalise"] = "refuse"
    """What is done with rows that lack a value. With marginalise, on tori, they count by the angles
    that they have."""

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


def check_table_name(out: Path) -> None:
    """Refuse a name for a table whose ending is that of another format."""
    if out.suffix.lower() in OTHER_FORMATS:
        raise SettingError(
            f"{{out}} must end in {', '.join(TABLES)}, got {literal(repr(out.name))}"
        )
