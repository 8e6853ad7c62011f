"""A finished solid whose copies fill space: all that is known of it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, InputFileError
from orbiflow.runtime import array_bytes, read_arrays
from orbiflow.solids.assembly import Leaving
from orbiflow.solids.certificate import SolidCertificate, certify_solid
from orbiflow.solids.likeness import SolidLikeness
from orbiflow.solids.mesh import Mesh
from orbiflow.solids.separable import pieces_with_gap
from orbiflow.symmetry import CrystallographicGroup, group_from_header, group_header

SOLID = "solid.safetensors"
"""The file of a solid in its folder."""

MESHES = ("tile", "target", "bent")


@dataclass(frozen=True, eq=False)
class EscherSolid:
    """A solid that looks like a target and whose copies under a space group fill space.

    - `name`: What it was made of.
    - `group`: The space group.
    - `tile`: The solid; its volume is 1.
    - `target`: The target over it, moved rigidly, of volume 1.
    - `bent`: The target bent, of which the solid was made.
    - `millimetres`: The length of one unit.
    - `likeness`: How much it looks like its target.
    - `upright`: What is right, backwards and up for the target where it lies, as columns (3, 3).
    - `seconds`: Computing time.
    """

    name: str
    group: CrystallographicGroup
    tile: Mesh
    target: Mesh
    bent: Mesh
    millimetres: float
    likeness: SolidLikeness
    upright: Array
    seconds: float = 0.0

    @property
    def group_name(self) -> str:
        """The symbol of the space group."""
        return self.group.name

    @property
    def size(self) -> Array:
        """Width, depth and height of the solid's box (3,) in mm."""
        return np.ptp(self.tile.points, axis=0) * self.millimetres

    @property
    def volume(self) -> float:
        """Its volume in mm^3."""
        return self.tile.volume * self.millimetres**3

    @cached_property
    def certificate(self) -> SolidCertificate:
        """The proof that its copies fill space, made when it is first asked for."""
        return certify_solid(self.group, self.tile)

    @cached_property
    def leaving(self) -> Leaving:
        """How it is best drawn out of a stack by a straight move, found when it is first asked for.

        Copies have a small gap, as prints do; where all of them leave by one move, it is that.
        """
        return pieces_with_gap(self.group, self.tile).leaving_stack()

    def sized(self, longest: float | None) -> EscherSolid:
        """Return the solid with a longest side of so many mm; None leaves it as it is."""
        if longest is None:
            return self
        return replace(self, millimetres=longest / float(np.ptp(self.tile.points, axis=0).max()))

    def require_certified(self) -> None:
        """Raise `CertificationError` if its copies do not fill space."""
        if not self.certificate.valid:
            raise CertificationError(
                f"{self.name} in {self.group_name} does not fill space: "
                f"{'; '.join(self.certificate.reasons)}; search again with another seed or group"
            )

    def to_bytes(self) -> bytes:
        """Return the content of a file that `read_solid` reads again."""
        header = {
            "name": self.name,
            "group": {"name": self.group.name, **group_header(self.group)},
            "millimetres": self.millimetres,
            "likeness": self.likeness.as_dict(),
            "seconds": self.seconds,
        }
        arrays: dict[str, Array] = {"upright": self.upright}
        for key in MESHES:
            mesh: Mesh = getattr(self, key)
            arrays |= {f"{key} points": mesh.points, f"{key} faces": mesh.faces.astype(np.int32)}
        return array_bytes(header, arrays, "a solid")


def read_solid(path: str | Path) -> EscherSolid:
    """Return a solid from its file, or from the folder that holds it; it is not certified yet.

    Raises `InputFileError` for a file that is damaged or holds no solid.
    """
    path = Path(path)
    file = path / SOLID if path.is_dir() else path
    header, arrays = read_arrays(file, "a solid")
    try:
        group: dict[str, Any] = header["group"]
        likeness = {name: float(header["likeness"][name]) for name in SolidLikeness.__annotations__}
        meshes = {key: Mesh(arrays[f"{key} points"], arrays[f"{key} faces"]) for key in MESHES}
        return EscherSolid(
            name=str(header["name"]),
            group=group_from_header(group, group["name"]),
            millimetres=float(header["millimetres"]),
            likeness=SolidLikeness(**likeness),
            upright=np.reshape(arrays["upright"], (3, 3)),
            seconds=float(header["seconds"]),
            **meshes,
        )
    except (KeyError, TypeError, ValueError) as error:
        raise InputFileError(f"{file}: not a solid saved by orbiflow ({error})") from error
