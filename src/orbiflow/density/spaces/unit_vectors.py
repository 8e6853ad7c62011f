"""Spheres of any dimension and their quotients by finite groups: axes, rotations, orientations."""

from __future__ import annotations

import math
import warnings
from typing import Any, ClassVar, Self, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation
from scipy.special import gammaln
from torch import Tensor

from orbiflow.arguments import as_choice, as_whole
from orbiflow.arrays import Array
from orbiflow.density.spaces.flat import MAX_DIM, whole_turn
from orbiflow.density.spaces.round import UNIT_TOLERANCE, refuse_rows, to_unit
from orbiflow.density.spaces.space import Space, checked_table
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.typed_torch import linalg


class UnitVectorSpace(Space):
    """The unit sphere S^d in d + 1 coordinates, modulo a finite group of isometries.

    There is no chart of the square: chart points are unit vectors (N, d + 1), and the measure
    "square" is the sphere's own area. So there are kernels and mixtures of von Mises-Fisher
    densities, but neither flows nor pictures. Of the images of a point, the canonical one has the
    largest last coordinate. A subclass gives its elements, `columns`, `for_data` and `settings`.

    Args:
        elements: Orthogonal matrices (E, d + 1, d + 1): all elements of the group, the identity first.
    """

    is_round = True
    has_chart = False

    def __init__(self, elements: Array) -> None:
        self.elements = torch.tensor(elements)
        # nothing but the last coordinate, until two images are as high
        side = 1e-6 / np.arange(2.0, elements.shape[1] + 2) ** 0.5
        self._height = torch.tensor(side + np.eye(len(side))[-1])

    @property
    def dim(self) -> int:
        return self.chart_dim - 1

    @property
    def chart_dim(self) -> int:
        return self.elements.shape[1]

    @property
    def group(self) -> CrystallographicGroup:  # pyright: ignore[reportIncompatibleVariableOverride]
        raise OrbiflowError(
            f"the {self.name} has no chart of the square and no crystallographic group: densities "
            "there are made of kernels and mixtures"
        )

    @property
    def volume(self) -> float:
        half = self.chart_dim / 2
        return 2 * math.exp(half * math.log(math.pi) - float(gammaln(half))) / len(self.elements)

    def log_area(self, points: Tensor) -> Tensor:
        return torch.zeros_like(points[..., 0])

    def project(self, points: Tensor) -> Tensor:
        first = best = self._unit(points)
        height = self._height.to(best)
        for element in self.elements.to(best)[1:]:
            image = first @ element.mT
            best = torch.where((image @ height > best @ height)[..., None], image, best)
        return best

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        own = self._unit(points)
        return torch.stack([own @ element.mT for element in self.elements.to(own)[which]])

    @property
    def kernel_images(self) -> int:
        return len(self.elements)

    def from_features(self, features: Tensor) -> Tensor:
        return self.project(features)

    def _unit(self, points: Tensor) -> Tensor:
        points = self._checked(points)
        length = linalg.vector_norm(points, dim=-1, keepdim=True)
        if bool(((length - 1).abs() > UNIT_TOLERANCE).any()):
            raise OrbiflowError(f"chart points of the {self.name} must be unit vectors")
        return points / length

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.project(self.cover(data))

    def cover(self, data: ArrayLike) -> Tensor:
        table = checked_table(data, (self.chart_dim,), f"unit vectors of {self.chart_dim} numbers")
        return torch.tensor(to_unit(table))

    def from_chart(self, points: Tensor) -> Array:
        return self.project(points).detach().double().cpu().numpy()

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data, points
        return gradient.numpy()

    def step_angle(self, step: float) -> float:
        return step

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        vectors = torch.randn(count, self.chart_dim, dtype=torch.float64, generator=generator)
        return self.project(vectors / linalg.vector_norm(vectors, dim=1, keepdim=True))


class Hypersphere(UnitVectorSpace):
    """The unit sphere S^d of d + 1 coordinates; densities are per unit of its area.

    Args:
        dim: The dimension d, 1 to 64.

    >>> Hypersphere(3).columns, round(Hypersphere(3).volume / math.pi**2, 12)
    (('x1', 'x2', 'x3', 'x4'), 2.0)
    """

    name = "hypersphere"
    signs: ClassVar[tuple[int, ...]] = (1,)

    def __init__(self, dim: int = 3) -> None:
        size = as_whole(dim, "dim", 1, MAX_DIM) + 1
        self.columns = tuple(f"x{k + 1}" for k in range(size))
        super().__init__(np.stack([sign * np.eye(size) for sign in self.signs]))

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del unit, seed
        return cls(data.shape[1] - 1)

    def settings(self) -> dict[str, Any]:
        return {"dim": self.dim}


class ProjectiveSpace(Hypersphere):
    """The space of axes in d + 1 coordinates, which are unit vectors without a sense."""

    name, signs = "projective-space", (1, -1)


CRYSTALS = ("C1", "C2", "C3", "C4", "C6", "D2", "D3", "D4", "D6", "T", "O", "I")
"""Rotation groups of crystals, and that of the icosahedron, in the notation of Schoenflies."""

FORMS: dict[str, tuple[str, ...]] = {
    "quaternion": ("x", "y", "z", "w"),
    "vector": ("rx", "ry", "rz"),
    "matrix": tuple(f"r{i}{j}" for i in "123" for j in "123"),
}
"""Columns of rotations in each form: a quaternion's scalar is last, a vector is axis times angle."""

EULER = ("ZXZ", "ZYZ", "XYZ", "ZYX", "xyz", "zyx")
"""Axes of Euler angles: fixed ones or, in capitals, those that turn along."""


class RotationSpace(UnitVectorSpace):
    """The rotations SO(3), as unit quaternions up to sign, or orientations of crystals.

    The natural measure is the area of the sphere of quaternions: pi^2 in all, divided by the order of
    the crystal's group. (In radians of rotation it would be eight times as much, 8 pi^2 in all.) Of a
    rotation's images, the canonical one has the smallest angle.

    Args:
        form: How `from_chart` writes rotations: "quaternion" (x, y, z, w), "vector" (axis times angle),
            "matrix" (nine numbers, row by row), or Euler angles by their axes, such as "ZXZ" for
            Bunge's. `to_chart` knows quaternions and matrices by their width.
        unit: Unit of vectors and Euler angles: "radians", "degrees" or "turns".
        symmetry: Rotation group of the crystal, such as "O" (cubic) or "D6" (hexagonal): the rotation
            g is the same orientation as g s for each s of the group. Default: none, "C1".

    >>> space = RotationSpace(form="ZXZ", unit="degrees", symmetry="O")
    >>> space.from_chart(space.to_chart([[100.0, 0.0, 0.0]])).round(9).tolist()
    [[10.0, 0.0, 0.0]]
    """

    name = "rotation-space"
    crystal: ClassVar[str] = "C1"
    of_three: ClassVar[str] = "vector"

    def __init__(
        self, *, form: str = "quaternion", unit: str = "radians", symmetry: str | None = None
    ) -> None:
        self.form = as_choice(form, (*FORMS, *EULER), "form")
        self.period, self.angle_unit = whole_turn(unit), unit
        self.symmetry = as_choice(symmetry or self.crystal, CRYSTALS, "symmetry")
        self.columns = FORMS.get(form, ("angle1", "angle2", "angle3"))
        # products from the right are linear: their columns are those with the four units
        turns = Rotation.create_group(cast(Any, self.symmetry))
        products = [(Rotation.from_quat(np.eye(4)) * turn).as_quat().T for turn in turns]
        both = np.stack([sign * product for sign in (1, -1) for product in products])
        super().__init__(both[np.argsort(-np.trace(both, axis1=1, axis2=2), kind="stable")])

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del seed
        return cls(form={3: cls.of_three, 9: "matrix"}.get(data.shape[1], "quaternion"), unit=unit)

    @property
    def widths(self) -> tuple[int, ...]:
        return (3, 4, 9)

    def cover(self, data: ArrayLike) -> Tensor:
        what = "rotations (a vector, a quaternion or a matrix in each row)"
        table = checked_table(data, self.widths, what)
        if table.shape[1] == 4:
            return torch.tensor(to_unit(table))
        rotations = _from_matrices(table) if table.shape[1] == 9 else self._from_angles(table)
        return torch.tensor(rotations.as_quat())

    def _from_angles(self, table: Array) -> Rotation:
        angles, euler = table * (2 * math.pi / self.period), self.form in EULER
        refuse_rows(
            (abs(angles).max(axis=1) if euler else np.linalg.norm(angles, axis=1)) > 6.2832,
            lambda row: (
                f"{table[row].tolist()} is more than a turn in {self.angle_unit}: change the unit"
            ),
        )
        return Rotation.from_euler(self.form, angles) if euler else Rotation.from_rotvec(angles)

    def from_chart(self, points: Tensor) -> Array:
        found = Rotation.from_quat(super().from_chart(points).reshape(-1, 4))
        if self.form == "quaternion":
            return found.as_quat()
        if self.form == "matrix":
            return found.as_matrix().reshape(-1, 9)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # of gimbal lock, where one angle is free
            euler = self.form in EULER
            own: Array = found.as_euler(cast(Any, self.form)) if euler else found.as_rotvec()
        return own * (self.period / (2 * math.pi))

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        """Return gradients (N, 4) at unit quaternions, tangent to their sphere."""
        if np.shape(data)[1] != 4:
            raise OrbiflowError("gradients of rotations need unit quaternions: convert the rows")
        return super().data_gradient(data, points, gradient)

    def step_angle(self, step: float) -> float:
        return 2 * math.pi * step / self.period

    def settings(self) -> dict[str, Any]:
        return {"form": self.form, "unit": self.angle_unit, "symmetry": self.symmetry}


def _from_matrices(table: Array) -> Rotation:
    matrices = table.reshape(-1, 3, 3)
    off = abs(matrices @ matrices.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2))
    refuse_rows(
        (off > 2 * UNIT_TOLERANCE) | (np.linalg.det(matrices) < 0),
        lambda row: f"{table[row].round(4).tolist()} is no rotation matrix, row by row",
    )
    return Rotation.from_matrix(matrices)


class CubicOrientations(RotationSpace):
    """Orientations of cubic crystals ("O"); three columns are Bunge's Euler angles phi1, Phi, phi2."""

    name, crystal, of_three = "cubic-orientations", "O", "ZXZ"


class HexagonalOrientations(RotationSpace):
    """Orientations of hexagonal crystals ("D6"), otherwise as of cubic ones."""

    name, crystal, of_three = "hexagonal-orientations", "D6", "ZXZ"
