"""A tile's place: the group element that takes a prototile there."""

from __future__ import annotations

from dataclasses import dataclass

from orbiflow.symmetry import Isometry


@dataclass(frozen=True, eq=False, repr=False)
class Placed(Isometry):
    """An isometry, and the number of the prototile that it carries.

    What is carried stays the same whatever else is done to it: `g @ placed` is where g takes that
    tile.

    >>> import numpy as np
    >>> from orbiflow.symmetry import translation
    >>> second = Placed(np.eye(2), np.zeros(2), 1)
    >>> (translation([3.0, 0.0]) @ second).prototile
    1
    """

    prototile: int = 0

    def __matmul__(self, other: Isometry) -> Isometry:
        """As of isometries; of what `other` carries, if that carries anything."""
        product = Isometry.__matmul__(self, other)
        if isinstance(other, Placed) and product is not NotImplemented:
            return Placed(product.linear, product.translation, other.prototile)
        return product

    def __rmatmul__(self, other: Isometry) -> Placed:
        product = Isometry.__matmul__(other, self)
        return Placed(product.linear, product.translation, self.prototile)

    def __repr__(self) -> str:
        return f"{Isometry.__repr__(self)[:-1]}, prototile={self.prototile})".replace(
            "Isometry", "Placed", 1
        )


def prototile_of(element: Isometry) -> int:
    """The number of the prototile that an isometry carries: 0 unless it says."""
    return element.prototile if isinstance(element, Placed) else 0
