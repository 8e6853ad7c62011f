"""Space groups whose lattice may still change, as far as their point group allows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike

from orbiflow.arrays import Array, Integers
from orbiflow.errors import GroupError
from orbiflow.symmetry import CrystallographicGroup, space_group

# groups whose tiles looked best; benchmarks/space_filling.py --groups finds that most are as good
USUAL_GROUPS = (
    "P 1",
    "P -1",
    "P 21",
    "P c",
    "P 21/c",
    "P 21 21 21",
    "P c a 21",
    "P n a 21",
    "P 41",
)


@dataclass(frozen=True, eq=False)
class GroupFamily:
    """The groups of one name whose fundamental domains have volume 1.

    What they differ in is a symmetric matrix that commutes with the point group, whose exponential
    stretches space: the commutant of the point group, computed. In the coordinates of the lattice all
    have the same operations.

    - `base`: One of them.

    >>> [GroupFamily.named(name).freedom for name in ("P 1", "P 21", "P 21 21 21", "P 41", "P 21 3")]
    [5, 3, 2, 1, 0]
    """

    base: CrystallographicGroup

    @classmethod
    def named(cls, name: str | int) -> GroupFamily:
        """Return the family of a space group, by its number or symbol.

        Raises:
            GroupError: For an unknown name, and for groups with reflections: a mirror would cut each
                solid flat.
        """
        # solids are found anywhere in the cell: another origin only moves all of them together
        group = space_group(name, origin=1)
        for element in group.cosets:
            if np.isclose(np.trace(element.linear), 1) and np.linalg.det(element.linear) < 0:
                _refuse_mirrors(group, name)
                break
        side = (group.order / group.cell_volume) ** (1 / 3)
        return cls(group.conjugate(side * np.eye(3)))

    @property
    def name(self) -> str:
        """The symbol of the group."""
        return self.base.name

    @property
    def order(self) -> int:
        """Number of cosets of the lattice, which is the volume of its cell."""
        return self.base.order

    @cached_property
    def turns(self) -> Integers:
        """(q, 3, 3) linear parts in the lattice's coordinates."""
        return self.base.integral_parts

    @cached_property
    def shifts(self) -> Array:
        """(q, 3) translations in the lattice's coordinates."""
        return self.base.translations @ self.base.inverse_lattice.T

    @cached_property
    def stretches(self) -> Array:
        """(k, 3, 3) an orthonormal basis of the symmetric matrices, of trace 0, that commute."""
        symmetric = []
        for i in range(3):
            for j in range(i, 3):
                matrix = np.zeros((3, 3))
                matrix[i, j] = matrix[j, i] = 1.0 if i == j else np.sqrt(0.5)
                symmetric.append(matrix)
        rows = np.array(symmetric)
        lost = [linear @ rows - rows @ linear for linear in self.base.linear_parts]
        trace = np.trace(rows, axis1=1, axis2=2)[:, None]
        system = np.concatenate([np.concatenate(lost, axis=1).reshape(6, -1), trace], axis=1).T
        return np.einsum("ak,aij->kij", scipy.linalg.null_space(system), rows)

    @property
    def freedom(self) -> int:
        """How many numbers the lattice has, beside its volume."""
        return len(self.stretches)

    def stretch(self, values: ArrayLike) -> Array:
        """Return the matrix (3, 3) that stretches the base by so many numbers (k,)."""
        amounts = np.asarray(values, float)
        return (
            scipy.linalg.expm(np.einsum("k,kij->ij", amounts, self.stretches))
            if len(amounts)
            else np.eye(3)
        )

    def lattice(self, values: ArrayLike) -> Array:
        """Return the lattice (3, 3) of one of the groups, basis vectors as columns."""
        return self.stretch(values) @ self.base.lattice

    def group(self, values: ArrayLike) -> CrystallographicGroup:
        """Return one of the groups."""
        return self.base.conjugate(self.stretch(values))


def _refuse_mirrors(group: CrystallographicGroup, name: str | int) -> None:
    """Raise `GroupError` if one of the reflections with its translations is a mirror, no glide."""
    for element in group.cosets:
        if not (np.isclose(np.trace(element.linear), 1) and np.linalg.det(element.linear) < 0):
            continue
        # a glide's square is a translation; it is a mirror if some lattice vector takes its glide away
        half = (np.eye(3) + element.linear) / 2
        steps = np.array(np.meshgrid(*[range(-2, 3)] * 3)).reshape(3, -1).T @ group.lattice.T
        glides = (element.translation + steps) @ half.T
        if np.linalg.norm(glides, axis=1).min() < 1e-9:
            raise GroupError(
                f"{name} has mirrors, which would cut each solid flat: choose a group without, such as "
                f"{', '.join(USUAL_GROUPS[:6])}"
            )
