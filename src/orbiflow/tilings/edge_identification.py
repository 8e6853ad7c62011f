"""An edge identification: two edges, and the isometry that takes one onto the other."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from orbiflow.symmetry import Isometry

EdgeKind: TypeAlias = Literal["translation", "rotation", "glide", "mirror"]


class EdgeIdentification(NamedTuple):
    """`isometry` takes edge `first` onto edge `second`, and its tile to the other side of it.

    So across its edge `second` a tile T meets the copy isometry(T'), along that copy's `first`. The
    isometry says the rest. An edge may be its own partner: turned over about its middle, or on a
    mirror, which leaves it as it is.
    """

    first: int
    second: int
    isometry: Isometry

    @property
    def folded(self) -> bool:
        """Whether the edge is its own partner."""
        return self.first == self.second

    @property
    def reversed(self) -> bool:
        """Whether the start of `first` goes to the end of `second`: unless orientation is reversed.

        All tiles run the same way around, so edges that two share run opposite ways.
        """
        return self.isometry.determinant > 0

    @property
    def kind(self) -> EdgeKind:
        """What the isometry is."""
        linear, shift = self.isometry.linear, self.isometry.translation
        if self.isometry.determinant > 0:
            return "translation" if np.abs(linear - np.eye(2)).max() < 1e-6 else "rotation"
        twice = linear @ shift + shift  # the translation that a transflection applied twice is
        still = np.abs(twice).max() <= 1e-6 * np.abs(shift).max() + 1e-12
        return "mirror" if self.folded or still else "glide"

    @property
    def brief(self) -> str:
        """In brief: = translation, ~ glide, > rotation, | mirror, o turned over about its middle.

        >>> from orbiflow.symmetry import rotation, translation
        >>> across = EdgeIdentification(0, 3, translation([1.0, 0.0]))
        >>> across.brief, EdgeIdentification(2, 2, rotation([1.0, 0.0], 2)).brief
        ('0=3', '2o')
        """
        kind = self.kind
        if self.folded and kind in ("rotation", "mirror"):
            return f"{self.first}{'o' if kind == 'rotation' else '|'}"
        sign = {"translation": "=", "glide": "~", "rotation": ">", "mirror": "|"}[kind]
        return f"{self.first}{sign}{self.second}"
