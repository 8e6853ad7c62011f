"""A check for tests: does a function commute with a crystallographic group?"""

from collections.abc import Callable
from typing import Literal

import numpy as np
import torch
from torch import Tensor

from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.elements import lattice_along
from orbiflow.symmetry.group import CrystallographicGroup, checked_group
from orbiflow.symmetry.isometry import Isometry, translation
from orbiflow.typed_torch import listed

Kind = Literal["field", "map", "invariant"]
ROUNDING = 1e-13  # of values that come out as zero: of fields in cells, of invariants as they are
_LAWS = {"field": "V(g p) = R_g V(p)", "map": "D(g p) = g D(p)", "invariant": "f(g p) = f(p)"}


class EquivarianceError(AssertionError):
    """A function that does not commute with a group.

    - `element`: The element of the group for which it fails.
    - `error`: The largest deviation.
    """

    def __init__(self, message: str, element: Isometry, error: float) -> None:
        super().__init__(message)
        self.element, self.error = element, error


@torch.no_grad()
def assert_equivariant(
    function: Callable[[Tensor], Tensor],
    group: CrystallographicGroup,
    *,
    kind: Kind = "field",
    along: str | None = None,
    points: Tensor | None = None,
    atol: float | None = None,
    rtol: float = 1e-9,
    cells: int = 1,
    seed: int = 0,
) -> None:
    """Raise unless `function` commutes with `group` at sampled points, in any dimension.

    Use it to test your own fields and maps. Every coset representative g, also moved by `cells`
    cells along each lattice vector, is checked against the law of the kind:

    - "field": V(g p) = R_g V(p), vectors are pushed forward by the linear part (paper, section 3);
    - "map": D(g p) = g D(p), such as a flow;
    - "invariant": f(g p) = f(p), such as a log-density.

    Args:
        function: A function of points (N, d).
        group: A group of R^d.
        kind: "field", "map" or "invariant".
        along: The axes that the group is periodic along, as for `symmetrize`. Default: all.
        points: Points (N, d). Default: 32 random float64 points in a cell.
        atol: The deviation that is accepted whatever the values, in their unit. Default: of maps 1e-9
            of the cell's size, which is the d-th root of its volume; of fields and invariants, whose
            own values say how large they are, rounding alone.
        rtol: The deviation that is accepted beside it, relative to the largest value.
        cells: The number of cells to move by.
        seed: The seed of the default points.

    Raises:
        EquivarianceError: an AssertionError that names the worst coset, the error and the point.
        OrbiflowError: for an unknown kind, or values of the wrong shape.

    >>> from orbiflow.symmetry import wallpaper_group
    >>> p4 = wallpaper_group("p4")
    >>> assert_equivariant(lambda p: p, p4, kind="map")
    >>> assert_equivariant(lambda p: torch.ones_like(p), p4)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    orbiflow.symmetry.equivariance.EquivarianceError: V(g p) = R_g V(p) fails for ...
    """
    group = checked_group(group)
    if kind not in _LAWS:
        raise OrbiflowError(f"kind must be 'field', 'map' or 'invariant', got {kind!r}")
    if points is None:
        source = torch.Generator().manual_seed(seed)
        unit = torch.rand(32, group.dim, dtype=torch.float64, generator=source)
        points = unit @ torch.tensor(np.array(group.lattice)).mT
    values = _values(function, points, kind)
    lattice = group.lattice if along is None else lattice_along(group, along)
    worst: tuple[float, int, Isometry, Tensor] | None = None
    moves = [translation(sign * cells * vector) for vector in lattice.T for sign in (1, -1)]
    cosets = enumerate(group.cosets, start=1)
    for number, element in ((k, h) for k, g in cosets for h in (g, *(m @ g for m in moves))):
        moved = {"field": element.push, "map": element}.get(kind)
        expected = moved(values) if moved else values
        errors = (_values(function, element(points), kind) - expected).abs()
        largest = float(errors.max())
        # NaN compares as false
        if worst is None or not largest <= worst[0]:
            at = points[int(errors.reshape(len(points), -1).amax(dim=1).argmax())]
            worst = (largest, number, element, at)
    size = group.cell_volume ** (1 / group.dim)
    least = {"map": 1e-9 * size, "field": ROUNDING * size, "invariant": ROUNDING}[kind]
    allowed = least if atol is None else atol
    allowed += rtol * float(values.abs().max())
    if worst is not None and not worst[0] <= allowed:
        error, number, element, at = worst
        raise EquivarianceError(
            f"{_LAWS[kind]} fails for {group!r}, worst in coset {number} of {group.order}, g = "
            f"{element!r}: off by {error:.1e} at p = {listed(at)}, {allowed:.1e} allowed",
            element,
            error,
        )


def _values(function: Callable[[Tensor], Tensor], points: Tensor, kind: Kind) -> Tensor:
    values = function(points)
    wanted = points.shape if kind != "invariant" else values.shape
    if values.shape != wanted or values.shape[:1] != points.shape[:1]:
        raise OrbiflowError(
            f"a {kind} at points of shape {tuple(points.shape)} must give values of that shape "
            f"({'of length N for' if kind == 'invariant' else 'expected for'} every point), got "
            f"{tuple(values.shape)}"
        )
    return values
