"""Which columns and rows of a table are read: settings that the density commands share."""

from __future__ import annotations

import math
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
    "rotation-space", "cubic-orientations", "hexagonal-orientations",
]  # fmt: skip
SPACES: tuple[str, ...] = get_args(SpaceName)

RotationForm = Literal[
    "bunge", "vector", "rodrigues", "quaternion", "scalar-first", "matrix",
    "ZXZ", "ZYZ", "XYZ", "ZYX", "xyz", "zyx",
]  # fmt: skip


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
    """Columns that are real numbers, such as length,temperature: of a torus or beside another space."""

    period: Annotated[tuple[str, ...], DefaultText("none")] = ()
    """Columns with periods of their own, likewise, such as hour=24,day=365.25; of axes in degrees,
    180."""

    unit: Annotated[Unit | None, DefaultText("radians, if no value is beyond 2 pi")] = None
    """Unit of angles on the torus and the Klein bottle, and of rotations in three columns."""

    crystal: Annotated[str | None, DefaultText("that of the space, or none")] = None
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
        if twice := {name for name in self.beside if self.beside.count(name) > 1}:
            text = (
                f"{literal(min(twice))} is named twice in {{linear}} and {{period}}: name it once"
            )
            raise SettingError(text)
        self._check_rotations()
        _ = self.width  # which makes the group
        check_unit(self.space, self.unit)

    @property
    def periods(self) -> dict[str, float]:
        """The periods of columns that have their own, by name."""
        return dict(map(_period, self.period))

    @property
    def beside(self) -> tuple[str, ...]:
        """The columns that are real or have a period of their own."""
        return (*self.linear, *self.periods)

    def _check_rotations(self) -> None:
        """Check that what is of rotations is asked of rotations, and that there are such symmetries."""
        asked = {name: getattr(self, name) for name in ("crystal", "specimen", "form", "passive")}
        given = [name for name, value in asked.items() if value]
        if not given:
            return
        if self.space not in ROTATIONS:
            raise SettingError(
                f"{{{given[0]}}} is for rotations, not for the {literal(self.space)}: take {{space}} "
                "rotation-space"
            )
        if self.crystal is not None and self.space != ROTATIONS[0]:
            raise SettingError(
                f"{{crystal}} is for the rotation-space: the {self.space} have a symmetry of their own"
            )
        from orbiflow.density.spaces import make_space

        own = {"symmetry": self.crystal, "specimen": self.specimen, "passive": self.passive}
        try:
            make_space(self.space, form=self.form or "quaternion", **own)
        except SettingError as error:
            raise SettingError(error.template.replace("{symmetry}", "{crystal}")) from error

    def rotation_form(self, names: Sequence[str]) -> str | None:
        """Return how columns of these names write rotations; None of no rotations.

        Three columns without names are Bunge's angles if there are crystals, else a vector.
        """
        if self.space not in ROTATIONS:
            return None
        width, form = len(names), "ZXZ" if self.form == "bunge" else self.form
        crystals = self.space != ROTATIONS[0] or self.crystal is not None
        default = {3: "ZXZ" if crystals else "vector", 9: "matrix"}.get(width, "quaternion")
        return rotation_form(self.space, names, width, form) or default

    @property
    def width(self) -> int | None:
        """The number of columns that the space takes, None if there may be several."""
        if self.space in SPACES:
            return 2 if self.space == "klein-bottle" else None
        return group_of(self.space, self.cell).dim


def _period(text: str) -> tuple[str, float]:
    name, _, number = text.rpartition("=")
    try:
        value = float(number)
    except ValueError:
        value = math.nan
    if not name.strip() or not 0 < value < math.inf:
        raise SettingError(
            f"{{period}} must hold columns with numbers above 0, such as hour=24, got "
            f"{literal(repr(text))}"
        )
    return name.strip(), value


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

    where: Annotated[tuple[str, ...], DefaultText("all rows")] = ()
    """Rows to read, by values of other columns, such as phase=1,site=north. Of values of one column, a
    row must have one, of several columns one in each."""

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
