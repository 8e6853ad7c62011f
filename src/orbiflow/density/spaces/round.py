"""The sphere and the projective plane, with their round area (design point 13).

The chart is the square, by conformal bijections of it under p4 with the sphere, under pgg with RP^2.
With nome exp(-pi) the function u = (theta_3 / theta_1)^2 at v = pi z / 2 has periods 2 and 2i,
u(iz) = -u(z), and the two glides of pgg act on it as the antipodal map -1 / conj(u). So w = u^2 takes
the square to the sphere and w = u to the projective plane (design point 13, where u is written
(1 + cn^2) / (1 - cn^2)). The theta quotient has no cancellation near its poles, its derivative is
another product of theta functions, and its inverse is Carlson's R_F: all exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Self

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from scipy.special import elliprf
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.data import is_code, written_from_zero
from orbiflow.density.spaces.checked import checked_table, row_count
from orbiflow.density.spaces.space import Space, named_group
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_choice, as_instance
from orbiflow.typed_torch import linalg

K = 1.854074677301371918433850347195
"""Quarter period K(m) of the elliptic functions with parameter m = 1/2."""

NULL3 = 1.086434811213308014575316121510
"""theta_3(0) = pi^(1/4) / Gamma(3/4)."""

NOME = math.exp(-math.pi)


def thetas(z: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return theta_1, ..., theta_4 at v = pi z / 2, for |Im z| <= 1.

    Of each series all terms above 1e-16, as polynomials in cos 2v.

    Reference: DLMF 20.2(i), https://dlmf.nist.gov/20.2.
    """
    across, along = z.real * (math.pi / 2), z.imag * (math.pi / 2)
    # complex sines are slow
    sin, cos, sinh, cosh = across.sin(), across.cos(), along.sinh(), along.cosh()
    sine, cosine = torch.complex(sin * cosh, cos * sinh), torch.complex(cos * cosh, -sin * sinh)
    double = 1 - 2 * sine * sine
    square, q = double * double, NOME
    small = q**6 - q**12
    even, odd = 1 - q**2 - small + 4 * small * square, 2 * (q**2 - q**6 - 2 * q**12)
    odd = (odd + 8 * q**12 * square) * double
    whole, part = 1 - 2 * q**4 + 4 * q**4 * square, 2 * q - 6 * q**9 + 8 * q**9 * square
    part = part * double
    first = 2 * q**0.25
    return first * sine * (even - odd), first * cosine * (even + odd), whole + part, whole - part


TINY = 1e-36
"""Least square of a theta function in a logarithm, since cone points have area factor 0."""


def to_sphere(points: Tensor, power: int) -> Tensor:
    """Return the unit vectors (..., 3) of points (..., 2) of the plane."""
    first, _, three, _ = thetas(_wrapped(points))
    below, above = (_square(theta) ** power for theta in (first, three))
    product = three * first.conj()
    for _ in range(power // 2):
        product = product * product
    size = below + above
    parts = [2 * product.real, 2 * product.imag, above - below]
    return torch.stack(parts, dim=-1) / size[..., None]


def log_area(points: Tensor, power: int) -> Tensor:
    """Return the logarithm of the area factor J (...,) of `to_sphere` at points (..., 2) of the plane.

    J = (power/2)^2 4 pi^2 theta_3(0)^4 |theta_1 theta_3|^(2 power - 2) |theta_2 theta_4|^2 /
    (|theta_1|^(2 power) + |theta_3|^(2 power))^2: from the derivative
    (theta_3/theta_1)' = -theta_3(0)^2 theta_2 theta_4 / theta_1^2 (DLMF 20.7(ii), 22.13).
    """
    first, two, three, four = (_square(theta).clamp_min(TINY) for theta in thetas(_wrapped(points)))
    constant = 2 * math.log(power * math.pi * NULL3**2)
    size = first**power + three**power
    return constant + (power - 1) * (first * three).log() + (two * four / (size * size)).log()


def from_sphere(vectors: Array, power: int) -> Array:
    """Return points (..., 2) of unit vectors (..., 3), somewhere in their orbit under p4 or pgg.

    u = a / b with b >= 0 and Re u >= 0, then K z = sqrt(2 b) R_F(a - b, a, a + b): the inverse of
    sn^2 = 2 / (u + 1) (DLMF 19.25(v)).
    """
    along: list[Array] = list(np.moveaxis(np.asarray(vectors, dtype=np.float64), -1, 0))
    x, y, z = along
    if power == 2:  # the one of the two opposite vectors with x >= 0
        sign = np.where(x < 0, -1.0, 1.0)
        x, y, z = sign * x, sign * y, sign * z
    radius = np.hypot(x, y)
    north = z > 0
    safe = np.where(radius == 0, 1.0, radius)
    a = np.where(north, np.where(radius == 0, 1.0, (x + 1j * y) / safe), x + 1j * y)
    b = np.where(north, radius / (1 + np.abs(z)), 1 - z)
    if power == 4:
        a, b = np.sqrt(a), np.sqrt(b)
    first = a - b + 0j
    # on the cut both sides are the same point of the space; SciPy needs to know which
    first = np.where((first.imag == 0) & (first.real < 0), first + 1e-300j, first)
    plane = np.sqrt(2 * b) * elliprf(first, a + 0j, a + b + 0j) / K
    return np.stack([plane.real, plane.imag], axis=-1)


def _wrapped(points: Tensor) -> Tensor:
    """Return complex numbers for points of the plane, moved by periods to |Re z|, |Im z| <= 1."""
    near = points - 2 * (points.detach() / 2).round()
    return torch.complex(near[..., 0], near[..., 1])


def _square(z: Tensor) -> Tensor:
    return z.real.square() + z.imag.square()


UNIT_TOLERANCE = 1e-3
"""Difference from 1 that the length of a unit vector may have."""

ROUNDING = 1e-4
"""Degrees by which numbers of single precision may be beyond 90 or 360."""

FORMS: dict[str, tuple[str, ...]] = {"latlon": ("lat", "lon"), "vector": ("x", "y", "z")}
"""Columns of directions in each form: degrees north and east, or unit vectors."""


def to_vectors(data: ArrayLike) -> Array:
    """Return unit vectors (N, 3) of directions, from latitudes and longitudes (N, 2) or vectors (N, 3).

    Raises:
        OrbiflowError: If a latitude is beyond 90 degrees, a longitude beyond 360, or the length of a
            vector not 1 within a thousandth.

    >>> to_vectors([[0.0, 90.0]]).round(12).tolist()
    [[0.0, 1.0, 0.0]]
    """
    table = checked_table(data, (2, 3), "directions")
    if table.shape[1] == 3:
        return to_unit(table)
    refuse_rows(
        abs(table[:, 0]) > 90 + ROUNDING,
        lambda row: (
            f"latitude {table[row, 0]:g} is beyond 90 degrees: "
            + _cause(table[row, 0], "are the columns lat, lon?")
        ),
    )
    refuse_rows(
        abs(table[:, 1]) > 360 + ROUNDING,
        lambda row: (
            f"longitude {table[row, 1]:g} is beyond 360 degrees"
            + _cause(table[row, 1], "").replace("is it", ": is it")
        ),
    )
    lat, lon = np.radians([table[:, 0].clip(-90, 90), table[:, 1]])
    return np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=-1)


def _cause(value: float, otherwise: str) -> str:
    """Return what may have made a value that no angle has."""
    code = "is it a code for a missing value? Then leave such rows out"
    return code if is_code(value) else otherwise


def to_latlon(vectors: Array, *, from_zero: bool = False) -> Array:
    """Return degrees (N, 2) of unit vectors (N, 3): latitude, and longitude in [-180, 180).

    Longitudes are in [0, 360) instead if they are written `from_zero`.
    """
    x, y, z = vectors.T
    lon: Array = np.degrees(np.arctan2(y, x))
    lat = np.degrees(np.arctan2(z, np.hypot(x, y)))
    first = 0.0 if from_zero else -180.0
    lon -= 360 * np.floor((lon - first) / 360)
    return np.stack([lat, np.where(lon >= first + 360, first, lon)], axis=-1)


def to_unit(table: Array) -> Array:
    """Return vectors (N, k), whose lengths must be 1 within a thousandth, at length 1."""
    length = np.linalg.norm(table, axis=1)
    other = "; latitude and longitude are for the sphere and the projective-plane"
    refuse_rows(
        abs(length - 1) > UNIT_TOLERANCE,
        lambda row: (
            f"the vector {table[row].tolist()} has length {length[row]:.4g}, not 1: "
            f"divide each by its length{other * (table.shape[1] == 2)}"
        ),
    )
    return table / length[:, None]


def refuse_rows(wrong: NDArray[np.bool_], message: Callable[[int], str]) -> None:
    """Refuse data some of whose rows are wrong, with what there is to say of the first."""
    rows = np.flatnonzero(wrong)
    if len(rows):
        raise OrbiflowError(f"row {rows[0] + 1}: {message(int(rows[0]))}{row_count(len(rows))}")


class RoundSpace(Space):
    """A quotient of the square with the area of the unit sphere: `Sphere` and `ProjectivePlane`.

    Args:
        form: How `from_chart` writes directions: "latlon" (degrees) or "vector". `to_chart` takes
            both.
        rotation: Rotation (3, 3) of the sphere in front of the chart. Densities are least flexible at
            the cone points, so it should move these away from the data (`clear_rotation`).
        from_zero: Whether `from_chart` writes longitudes from 0 to 360, otherwise from -180 to 180.
            Spaces that differ in this alone are equal.
    """

    power: int
    is_round = has_square = True

    @classmethod
    def for_data(cls, data: Array, *, unit: str = "radians", seed: int = 0) -> Self:
        del unit  # angles of directions are in degrees
        rotation = clear_rotation(cls(), data, seed=seed)
        if data.shape[1] == 3:
            return cls(form="vector", rotation=rotation)
        return cls(rotation=rotation, from_zero=bool(written_from_zero(data[:, 1:], 360.0)))

    def __init__(
        self, *, form: str = "latlon", rotation: ArrayLike | None = None, from_zero: bool = False
    ) -> None:
        turn = np.eye(3) if rotation is None else checked_table(rotation, (3,), "rotation")
        if turn.shape != (3, 3) or not np.allclose(turn @ turn.T, np.eye(3), atol=1e-9):
            raise OrbiflowError("rotation must be an orthogonal (3, 3) matrix")
        self.form = as_choice(form, tuple(FORMS), "form")
        self.columns = FORMS[self.form]
        self.rotation, self.from_zero = turn, as_instance(from_zero, bool, "from_zero")
        self.group = named_group(self.name)

    @property
    def periods(self) -> tuple[float, ...]:
        return tuple(360.0 * (column == "lon") for column in self.columns)

    @property
    def volume(self) -> float:
        return self.power * math.pi

    def log_area(self, points: Tensor) -> Tensor:
        return log_area(points, self.power)

    def vectors_to_chart(self, vectors: Array) -> Tensor:
        """Return the canonical points (N, 2) of unit vectors (N, 3)."""
        turned = np.asarray(vectors) @ self.rotation.T
        return self.project(torch.tensor(from_sphere(turned, self.power)))

    def unit_vectors(self, points: Tensor) -> Tensor:
        """Return unit vectors (..., 3) of chart points (..., 2), for an axis one of the two.

        The function is differentiable.
        """
        turned = to_sphere(points, self.power)
        return turned @ torch.as_tensor(self.rotation).to(turned)

    def vectors(self, points: Tensor) -> Array:
        """Return `unit_vectors` as a NumPy array, float64."""
        return self.unit_vectors(self._checked(points).detach().double().cpu()).numpy()

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        return self.unit_vectors(points)[None][which]

    @property
    def kernel_images(self) -> int:
        return 1

    def step_angle(self, step: float) -> float:
        return math.radians(step) if self.form == "latlon" else step

    def lifted(self, features: Tensor) -> Tensor:
        return self.vectors_to_chart(features.numpy())

    @property
    def widths(self) -> tuple[int, ...]:
        return (2, 3)

    def to_chart(self, data: ArrayLike) -> Tensor:
        return self.vectors_to_chart(to_vectors(data))

    def data_gradient(self, data: ArrayLike, points: Tensor, gradient: Tensor) -> Array:
        """Return gradients as any space does; at cone points, where there is none, NaN."""
        vectors = to_vectors(data)
        with torch.enable_grad():
            at = points.detach().clone().requires_grad_()
            vector = self.unit_vectors(at)
            rows = [
                torch.autograd.grad(coordinate.sum(), at, retain_graph=True)[0]
                for coordinate in vector.mT
            ]
        # conformal: the transpose over the squared scale is the inverse
        jacobian = torch.stack(rows, dim=1)
        scale = (jacobian**2).sum(dim=(1, 2)) / 2
        slope = (torch.einsum("nkd,nd->nk", jacobian, gradient) / scale[:, None]).numpy()
        # the chart may have the other end of an axis
        slope *= np.sign((vectors * vector.detach().numpy()).sum(axis=1, keepdims=True))
        if np.shape(data)[1] == 3:
            return slope
        lat, lon = np.radians(np.asarray(data, dtype=np.float64).T)
        sin, cos = np.sin(lat), np.cos(lat)
        north = [-sin * np.cos(lon), -sin * np.sin(lon), cos]
        east = [-cos * np.sin(lon), cos * np.cos(lon), 0 * lon]
        per_degree = [(slope * np.stack(way, axis=-1)).sum(axis=1) for way in (north, east)]
        return np.radians(np.stack(per_degree, axis=-1))

    def from_chart(self, points: Tensor) -> Array:
        vectors = self._representatives(self.vectors(points))
        return vectors if self.form == "vector" else self.latlon(vectors)

    def latlon(self, vectors: Array) -> Array:
        """Return degrees (N, 2) of unit vectors (N, 3), written as those of the data."""
        return to_latlon(vectors, from_zero=self.from_zero)

    def uniform(self, count: int, generator: torch.Generator) -> Tensor:
        vectors = torch.randn(count, 3, dtype=torch.float64, generator=generator)
        vectors = vectors / linalg.vector_norm(vectors, dim=1, keepdim=True)
        return self.vectors_to_chart(vectors.numpy())

    def cone_vectors(self) -> Array:
        """Return unit vectors of the chart's cone points, in the data's frame."""
        corners = torch.tensor([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0]], dtype=torch.float64)
        cones = corners if self.power == 4 else corners[[0, 2]]
        return to_sphere(cones, self.power).numpy() @ self.rotation

    def settings(self) -> dict[str, Any]:
        options = {"from_zero": True} if self.from_zero else {}
        return {"form": self.form, "rotation": self.rotation.tolist(), **options}

    def _representatives(self, vectors: Array) -> Array:
        return vectors


class Sphere(RoundSpace):
    """The unit sphere of directions; densities are per steradian.

    >>> space = Sphere()
    >>> space.from_chart(space.to_chart([[48.2, 16.4]])).round(9).tolist()
    [[48.2, 16.4]]
    """

    name = "sphere"
    power = 4


class ProjectivePlane(RoundSpace):
    """The projective plane of axes, which are directions without a sense; densities are per steradian.

    `from_chart` gives the end of an axis that is in the northern hemisphere.

    >>> space = ProjectivePlane()
    >>> space.from_chart(space.to_chart([[-30.0, 20.0]])).round(9).tolist()
    [[30.0, -160.0]]
    """

    name = "projective-plane"
    power = 2

    @property
    def kernel_images(self) -> int:
        return 2

    def features(self, points: Tensor, which: slice = slice(None)) -> Tensor:
        vectors = self.unit_vectors(points)
        return torch.stack([vectors, -vectors])[which]

    def _representatives(self, vectors: Array) -> Array:
        return np.where(vectors[:, 2:] < 0, -1.0, 1.0) * vectors


def clear_rotation(
    space: RoundSpace, data: ArrayLike, *, trials: int = 400, seed: int = 0
) -> Array:
    """Return a rotation (3, 3) that puts a space's cone points where there is little data.

    It is the one of `trials` random rotations that has the least von Mises-Fisher kernel density
    (concentration 30) at the cone points.
    """
    as_instance(space, RoundSpace, "space")
    vectors = to_vectors(data)
    rng = np.random.default_rng(seed)
    if len(vectors) > 5000:
        vectors = vectors[rng.choice(len(vectors), 5000, replace=False)]
    cones = type(space)().cone_vectors()
    turns = np.linalg.qr(rng.normal(size=(trials, 3, 3)))[0]
    turns *= np.sign(np.linalg.det(turns))[:, None, None]
    cosines = np.einsum("cj,tjk,nk->tcn", cones, turns, vectors)
    if space.power == 2:
        cosines = abs(cosines)
    load = np.exp(30 * (cosines - 1)).sum(axis=(1, 2))
    return turns[int(load.argmin())]
