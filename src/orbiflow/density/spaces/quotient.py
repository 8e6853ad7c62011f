"""R^d modulo any crystallographic group: plane orbifolds, flat manifolds, crystals."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from functools import cached_property
from typing import Any, Self, cast

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import fraction_doubts
from orbiflow.density.spaces.checked import checked_table
from orbiflow.density.spaces.frame import frame_of
from orbiflow.density.spaces.space import Space
from orbiflow.errors import DataWarning, OrbiflowError
from orbiflow.settings import as_array
from orbiflow.symmetry import (
    CrystallographicGroup,
    cell_lattice,
    checked_group,
    group_by_name,
    group_from_header,
    group_header,
)

COLUMNS = ("x", "y", "z")
MAX_DIM = 8
"""The most dimensions, for lists of 3^d neighbours."""


class QuotientSpace(Space):
    """R^d modulo a crystallographic group; its natural measure is volume in the data's unit.

    Data are points (N, d) in the coordinates in which the group acts; any point of an orbit may be
    given. `from_chart` returns points of one fundamental domain, the Dirichlet domain of a point far
    from its own images.

    A group without fixed points makes a manifold. Elsewhere the points that some elements fix are cone
    points, axes or mirrors. Densities are exact there as well, but no flow moves points off them.

    Args:
        group: A group, or its name (`orbiflow.symmetry.group_by_name`): one of the 17 plane groups, a
            flat 3-manifold such as "hantzsche-wendt", or a space group such as "P 21 21 21". Or its
            header (`group_header`), as files have it.
        cell: The lengths and angles of the cell of a group given by its name. Default: that of
            `group_by_name`.

        fractional: Whether data are fractions of the cell's vectors, as in CIF, and not Cartesian; or
            these vectors, as columns (d, d). Densities are per volume in the unit of the cell all the
            same.

    Raises `OrbiflowError` if there is no such group, the cell does not suit it, or fractions have none.

    >>> space = QuotientSpace("p4", cell=(2.0, 2.0))
    >>> space.volume
    1.0
    >>> quarter_turn = [[0.3, 0.1], [-0.1, 0.3]]
    >>> bool(np.ptp(space.from_chart(space.to_chart(quarter_turn)), axis=0).max() < 1e-12)
    True
    """

    name = "quotient"
    unit = "units"

    def __init__(
        self,
        group: CrystallographicGroup | str | Mapping[str, Any],
        *,
        cell: ArrayLike | None = None,
        fractional: bool | ArrayLike = False,
    ) -> None:
        if fractional is True and not (isinstance(group, str) and cell is not None):
            raise OrbiflowError(
                "fractions are of a cell: give cell as well, or its vectors as columns"
            )
        if isinstance(group, str):
            group = group_by_name(group, cell)
        elif cell is not None:
            raise OrbiflowError("a cell is for a group that is given by its name: leave it out")
        elif isinstance(group, Mapping):
            group = group_from_header(group, str(group.get("name", "")))
        self._given = checked_group(group)
        if self._given.dim > MAX_DIM:
            raise OrbiflowError(
                f"a quotient has {MAX_DIM} dimensions at most, not {self._given.dim}"
            )
        self.data_group = self._given
        size = (self._given.cell_volume / self._given.order) ** (1 / self._given.dim)
        frame = frame_of(self._given)
        basis = frame.group.lattice
        turn = basis / np.linalg.norm(basis, axis=0) if frame.is_rectangular else np.eye(len(basis))
        self._to_chart = turn.T / size
        # on a rectangle whose axes the group keeps, fields can be splines
        keeps_axes = frame.own == frame.group.order
        self.group = (frame.group if keeps_axes else self._given).conjugate(self._to_chart)
        self._vectors = self._checked_vectors(cell, fractional)
        if self._vectors is not None:
            self._to_chart = self._to_chart @ self._vectors
        self.columns = (
            COLUMNS[: self.dim] if self.dim <= 3 else tuple(f"x{k + 1}" for k in range(self.dim))
        )

    def _checked_vectors(
        self, cell: ArrayLike | None, fractional: bool | ArrayLike
    ) -> Array | None:
        """Return vectors (d, d), as columns, whose fractions the data are; None for Cartesian data."""
        if isinstance(fractional, bool):
            return _cell_vectors(self._given, cell) if fractional else None
        vectors = as_array(fractional, "fractional", (self.dim, self.dim))
        if abs(np.linalg.det(vectors)) < 1e-12:
            raise OrbiflowError("fractional must be vectors that span a cell, as columns")
        return vectors

    @cached_property
    def cartesian(self) -> QuotientSpace:
        """The same space, with the same chart, whose data are Cartesian coordinates."""
        return self if self._vectors is None else QuotientSpace(self._given)

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del data, unit, seed
        raise OrbiflowError("a quotient needs its group: give it by name, or QuotientSpace(group)")

    @property
    def is_torus(self) -> bool:
        """False: its data are places, not angles."""
        return False

    @property
    def volume(self) -> float:
        return self._given.cell_volume / self._given.order

    def cover(self, data: ArrayLike) -> Tensor:
        what = f"points of {self.dim} coordinates"
        return torch.tensor(checked_table(data, (self.dim,), what) @ self._to_chart.T)

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.project(self.cover(data))

    def from_chart(self, points: Tensor) -> Array:
        canonical: Array = self.project(points).detach().double().cpu().numpy()
        data = cast(Array, np.linalg.solve(self._to_chart, canonical.T))
        return data.T

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        del data, points
        return gradient.numpy() @ self._to_chart

    def settings(self) -> dict[str, Any]:
        header: dict[str, Any] = {"group": {**group_header(self._given), "name": self._given.name}}
        return header if self._vectors is None else {**header, "fractional": self._vectors.tolist()}

    def warn_of_fractions(self, data: Array, *, stacklevel: int = 2) -> None:
        """Warn if points (N, d) seem to be fractions of the cell and the space takes lengths."""
        sides = np.linalg.norm(self._given.lattice, axis=0)
        for doubt in fraction_doubts(data, sides.tolist()) if self._vectors is None else ():
            warnings.warn(doubt, DataWarning, stacklevel=stacklevel)

    def step_angle(self, step: float) -> float:
        longest = (
            1.0 if self._vectors is None else float(np.linalg.norm(self._vectors, axis=0).max())
        )
        return super().step_angle(step * longest)

    def __repr__(self) -> str:
        fractions = "" if self._vectors is None else f", fractional={self._vectors.tolist()}"
        return f"QuotientSpace({self._given!r}{fractions})"


def _cell_vectors(group: CrystallographicGroup, cell: ArrayLike | None) -> Array:
    """Return the vectors (d, d), as columns, of the conventional cell of a group given by its name."""
    if np.ndim(cast(Any, cell)) == 2 or group.dim != 2:
        numbers = np.asarray(cell, dtype=np.float64)
        return numbers if numbers.ndim == 2 else cell_lattice(numbers)
    a, b, *angle = np.asarray(cell, dtype=np.float64)
    if not angle and np.allclose(group.lattice[:, 0], [a, 0.0]):
        return group.lattice  # of a hexagonal plane: its angle may be left out
    return cell_lattice((a, b, a, 90.0, 90.0, angle[0] if angle else 90.0))[:2, :2]
