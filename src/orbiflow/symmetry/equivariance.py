"""A check for tests: does a function commute with a crystallographic group?"""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple

import numpy as np
import torch
from scipy.spatial import KDTree
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError
from orbiflow.symmetry.elements import lattice_along
from orbiflow.symmetry.group import CrystallographicGroup, checked_group
from orbiflow.symmetry.isometry import Isometry, translation
from orbiflow.typed_torch import listed

Kind = Literal["field", "map", "invariant"]
SCANNED = 4096  # points of the default that are each compared with one image
EVERYWHERE, STEEPEST = 32, 32  # how many of them, the first and the steepest, are compared with all
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
        points: Points (N, d), each compared with its images under all these g. Default: 32 points
            spread over a cell, and the 32 of 4096 at which the function is steepest; each of the 4096
            is also compared with its image under one g at random, in one of the (2 `cells` + 1)^d
            cells around. What is wrong in a small place alone may be missed: in the plane, discs of
            2 % of the cell's size as radius were all found within the cell, and those of 5 % in the
            cells around.
        atol: The deviation that is accepted whatever the values, in their unit. Default: of maps 1e-9
            of the cell's size, which is the d-th root of its volume; of fields and invariants, whose
            own values say how large they are, rounding alone.
        rtol: The deviation that is accepted beside it, relative to the largest value.
        cells: The number of cells to move by.
        seed: The seed of the default points.

    Raises:
        EquivarianceError: an AssertionError that names the worst coset, the error and the point, and
            how many points and cells were tried.
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
    lattice = group.lattice if along is None else lattice_along(group, along)
    moves = [translation(sign * cells * vector) for vector in lattice.T for sign in (1, -1)]
    worst: tuple[float, int, Isometry, Tensor] | None = None
    most, tried = 0.0, ""
    if points is None:
        scan = _scan(function, group, lattice, kind, cells, seed)
        points, worst, most = scan.chosen, scan.worst, scan.most
        tried = f"; {SCANNED} points tried in {(2 * cells + 1) ** lattice.shape[1]} cells"
    values = _values(function, points, kind)
    most = max(most, float(values.abs().max()))
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
    allowed += rtol * most
    if worst is not None and not worst[0] <= allowed:
        error, number, element, at = worst
        raise EquivarianceError(
            f"{_LAWS[kind]} fails for {group!r}, worst in coset {number} of {group.order}, g = "
            f"{element!r}: off by {error:.1e} at p = {listed(at)}, {allowed:.1e} allowed{tried}",
            element,
            error,
        )


class _Scan(NamedTuple):
    """The points to compare with all their images, and what many points and one image each gave."""

    chosen: Tensor
    worst: tuple[float, int, Isometry, Tensor]
    most: float


def _scan(
    function: Callable[[Tensor], Tensor],
    group: CrystallographicGroup,
    lattice: Array,
    kind: Kind,
    cells: int,
    seed: int,
) -> _Scan:
    """Compare many points of a cell with one image each, and choose those where the function varies."""
    unit = torch.quasirandom.SobolEngine(group.dim, scramble=True, seed=seed)
    basis = torch.tensor(np.array(group.lattice))
    points = unit.draw(SCANNED, dtype=torch.float64) @ basis.mT
    rng = np.random.default_rng(seed % 2**32)
    coset = rng.integers(group.order, size=SCANNED)
    linear = torch.tensor(group.linear_parts[coset])

    def turned(vectors: Tensor) -> Tensor:
        return (linear @ vectors[..., None])[..., 0]

    # the images lie in all cells around alike
    cell = rng.integers(-cells, cells, size=(SCANNED, lattice.shape[1]), endpoint=True)
    places = turned(points).numpy() + group.translations[coset]
    steps = cell - np.floor(places @ np.linalg.pinv(lattice).T)
    shift = torch.tensor(group.translations[coset] + steps @ lattice.T)

    values = _values(function, points, kind)
    images = _values(function, turned(points) + shift, kind)
    expected = values if kind == "invariant" else turned(values) + (shift if kind == "map" else 0.0)
    errors = (images - expected).abs().reshape(SCANNED, -1).amax(dim=1)
    at = int(errors.argmax())  # NaN is larger than any number
    number = int(coset[at])
    element = translation(lattice @ steps[at]) @ group.cosets[number]
    worst = (float(errors[at]), number + 1, element, points[at])
    # a narrow bump is steep: its slope is compared from each point to the next
    moved = (values - points if kind == "map" else values).reshape(SCANNED, -1)
    nearest: Any = KDTree(points.numpy()).query(points.numpy(), k=[2])
    apart, near = nearest
    slopes = (moved - moved[near[:, 0]]).abs().amax(dim=1) / torch.tensor(apart[:, 0])
    steepest = slopes.argsort(descending=True)[:STEEPEST]
    most = float(values.abs().max())
    return _Scan(torch.cat([points[:EVERYWHERE], points[steepest]]), worst, most)


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
