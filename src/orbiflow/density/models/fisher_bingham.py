"""Fisher-Bingham densities exp(a.x + x.Ax) on spheres, axes and rotations, with their constant.

The Watson, Bingham, Kent and matrix Fisher distributions are of this form.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import torch
from scipy.optimize import brentq, minimize_scalar
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.models.density import Density
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.settings import as_tensor
from orbiflow.typed_torch import linalg

NODES = 200
"""Points of the contour on one side of the real axis; half as many change no digit."""

LEAST_LOG, MOST_GROWTH, REACH = 45.0, 1e-9, 400
"""By how much the integrand has fallen, in nats, where the contour ends, by how much it may have grown
before, and ends that are tried."""

MOST_TRIES = 10_000
"""Rounds of rejection after which a sampler gives up, which none has reached."""


def log_fisher_bingham(values: Tensor, vector: Tensor) -> Tensor:
    """Return the logarithm of the integral of exp(a.x + sum of l_i x_i^2) over the unit sphere.

    The sphere's area times the density of the squared length of a normal vector at 1 is an inverse
    Laplace transform (Kume and Wood, Saddlepoint approximations for the Bingham and Fisher-Bingham
    normalising constants, 2005). Here it is no approximation: the trapezoidal rule on a
    parabola through the saddle point, about the cuts, has the error of rounding (Trefethen and
    Weideman, The exponentially convergent trapezoidal rule, 2014). It is differentiable any number of
    times.

    Args:
        values: Eigenvalues l (p,), in any order, p at least 2.
        vector: The vector a (p,) in the eigenvectors' coordinates.

    >>> one, none = torch.tensor([0.0, 0.0, 2.0]).double(), torch.zeros(3).double()
    >>> area = log_fisher_bingham(none, none).exp()
    >>> fisher = log_fisher_bingham(none, one).exp()  # 4 pi sinh(2) / 2
    >>> round(float(area) / math.pi, 12), round(float(fisher) / math.sinh(2) / math.pi, 12)
    (4.0, 2.0)
    """
    top, distance = _saddle(values.detach().numpy(), vector.detach().numpy())
    focus, end = _parabola(top - values.detach().numpy(), vector.detach().numpy(), distance)
    # points crowd towards the saddle point, as the highest eigenvalue may be much nearer than the focus
    nearest = distance / focus / (1 + math.sqrt(max(0.0, 1 - distance / focus)))
    longest = math.asinh(end / nearest)
    steps = (torch.arange(NODES, dtype=torch.float64) + 0.5) * (longest / NODES)
    along = nearest * steps.sinh()
    root = torch.complex(torch.ones_like(steps), along)
    # differences from the saddle point, where no digit is lost
    gap = top - values
    away, middle = focus * torch.complex(-(along**2), 2 * along), gap + distance
    at = middle + away[:, None]
    logs = away - (at / middle).log().sum(dim=1) / 2
    logs = logs - (vector**2 * away[:, None] / (at * middle)).sum(dim=1) / 4
    weights = 2 * focus * (longest / NODES) * nearest * steps.cosh()
    total = ((logs.exp() * root).real * weights).sum()
    saddle = top + distance - middle.log().sum() / 2 + (vector**2 / middle).sum() / 4
    return saddle + (total / math.pi).log() + math.log(2) + len(values) / 2 * math.log(math.pi)


def _saddle(values: Array, vector: Array) -> tuple[float, float]:
    """Return the largest eigenvalue, and how far above it the saddle point is."""
    top = float(values.max())
    gaps, squares = top - values, vector**2

    def excess(distance: float) -> float:
        return float((0.5 / (gaps + distance) + squares / (4 * (gaps + distance) ** 2)).sum()) - 1

    most = (len(values) + float(np.linalg.norm(vector))) / 2
    low = 0.5 - 1e-12
    root: Any = brentq(excess, low, most * (1 + 1e-9), rtol=1e-12)
    return top, float(root)


def _parabola(gaps: Array, vector: Array, distance: float) -> tuple[float, float]:
    """Return how far the focus is from the saddle point, and where the contour ends.

    About the highest eigenvalue the integrand falls fastest, unless many lower eigenvalues, or
    components of a at them, lift it before it has fallen far enough: then the focus is the nearest of
    these for which it does not grow.
    """
    middle, squares = gaps + distance, vector**2 / 4
    back = np.linspace(0.0, 2 * LEAST_LOG, REACH)[:, None]
    focus, end = distance, LEAST_LOG
    for focus in np.unique(middle).tolist():
        away = -back + 2j * np.sqrt(focus * back)
        at = middle + away
        logs = away[:, 0] - (np.log(at / middle) / 2 + squares * away / (at * middle)).sum(axis=1)
        enough = np.flatnonzero(logs.real <= -LEAST_LOG)
        end = float(back[enough[0], 0]) if len(enough) else LEAST_LOG
        if len(enough) and logs.real[: enough[0]].max() < MOST_GROWTH:
            break
    return focus, math.sqrt(end / focus)


def images_of(space: Space, vector: Tensor | None = None) -> int:
    """Return how many unit vectors stand for a point of a space: 1, or 2 for axes and rotations.

    Raises `OrbiflowError` for other spaces, and for axes with a `vector` that tells their ends apart.
    """
    some = space.features(space.uniform(1, torch.Generator().manual_seed(0)))
    count = len(some) if space.is_round else 0
    if count == 2 and not torch.allclose(some[1], -some[0]):
        count = 0
    if count not in (1, 2) or (count == 2 and vector is not None and bool(vector.any())):
        what = "this density" if vector is None or count != 2 else "a density with a mean direction"
        raise OrbiflowError(f"there is no such thing on the {space!r}: {what} is for other spaces")
    return count


class FisherBingham(Density, kind="fisher-bingham"):
    """The density exp(a.x + x.Ax) / c on a sphere or, with a = 0, on axes and rotations.

    Its constant is exact (`log_fisher_bingham`), and so are its samples: by rejection from an angular
    central Gaussian (Kent, Ganeiber and Mardia, A new unified approach for the simulation of a wide
    class of directional distributions, 2018).

    Args:
        space: A sphere, a space of axes, or that of rotations, whose vectors are quaternions.
        vector: The vector a (p,), in the data's own unit vectors.
        matrix: The symmetric matrix A (p, p).

    >>> from orbiflow.density import make_space
    >>> axis = torch.diag(torch.tensor([0.0, 0.0, 3.0]))
    >>> watson = FisherBingham(make_space("projective-plane"), torch.zeros(3), axis)
    >>> bool(watson.sample((4,)).isfinite().all())
    True
    """

    article = "a Fisher-Bingham density"
    stored = ("vector", "matrix")

    def __init__(self, space: Space, vector: Tensor, matrix: Tensor) -> None:
        super().__init__(space)
        self.vector = as_tensor(vector, "vector").detach().double()
        self.matrix = _symmetric(as_tensor(matrix, "matrix").detach().double(), space)
        if self.vector.shape != self.matrix.shape[:1] or not bool(self.vector.isfinite().all()):
            raise OrbiflowError("the vector must be as many finite numbers as the matrix has rows")
        images = images_of(space, self.vector)
        values, axes = linalg.eigh(self.matrix.cpu())
        constant = log_fisher_bingham(values, self.vector.cpu() @ axes)
        self._log_top = math.log(images) - float(constant)

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        del beside
        x = self.space.features(points.double())[0]
        return (x @ self.vector + ((x @ self.matrix) * x).sum(dim=-1) + self._log_top).to(points)

    def bumps(self) -> Tensor:
        _, axes = linalg.eigh(self.matrix.cpu())
        length = linalg.vector_norm(self.vector.cpu())
        mean = self.vector.cpu()[None] / length if length > 0 else axes.mT[-1:]
        return self.space.from_features(torch.cat([axes.mT, -axes.mT, mean]))

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        vector, matrix = self.vector.cpu().numpy(), self.matrix.cpu().numpy()
        kappa = float(np.linalg.norm(vector))
        mean = vector / kappa if kappa > 0 else vector
        # kappa c is at most kappa (c^2 + d^2) / (2 d) for any d: a Bingham density is an envelope
        nearest = _nearest_envelope(mean, kappa, matrix) if kappa > 0 else 1.0
        steep = kappa / (2 * nearest)
        values, axes = np.linalg.eigh(matrix + steep * np.outer(mean, mean))
        accepted: list[Array] = []
        for _ in range(MOST_TRIES):
            left = count - sum(map(len, accepted))
            if left <= 0:
                return self.space.from_features(torch.tensor(np.concatenate(accepted)[:count]))
            tried = _bingham(values.max() - values, 2 * left + 16, rng) @ axes.T
            odds = -steep * (tried @ mean - nearest) ** 2
            accepted.append(tried[np.log(rng.uniform(size=len(tried))) < odds])
        raise OrbiflowError("no samples were accepted: the density's parameters are too large")


def _nearest_envelope(mean: Array, kappa: float, matrix: Array) -> float:
    """Return the cosine d for which the Bingham density that is an envelope has the least mass."""
    none = torch.zeros(len(mean), dtype=torch.float64)

    def mass(nearest: float) -> float:
        values = np.linalg.eigvalsh(matrix + kappa / (2 * nearest) * np.outer(mean, mean))
        return float(log_fisher_bingham(torch.tensor(values), none)) + kappa * nearest / 2

    minimum: Any = minimize_scalar(mass, bounds=(1e-3, 1.0), method="bounded")
    return float(minimum.x)


def _bingham(below: Array, tries: int, rng: np.random.Generator) -> Array:
    """Return some of `tries` draws (n, p) of the density exp(-sum of b_i x_i^2), for b (p,) >= 0."""
    width = len(below)

    def excess(b: float) -> float:
        return float((1 / (b + 2 * below)).sum()) - 1

    root: Any = brentq(excess, 1 - 1e-12, width + 1e-9)
    b = float(root)
    scale = 1 + 2 * below / b
    tried = central_gaussian(scale**-0.5, tries, rng)
    odds = width / 2 * np.log(tried**2 @ scale) - tried**2 @ below
    most = width / 2 * math.log(width / b) - (width - b) / 2
    return tried[np.log(rng.uniform(size=tries)) < odds - most]


def central_gaussian(deviations: Array, count: int, rng: np.random.Generator) -> Array:
    """Return directions (count, p) of normal vectors with independent coordinates."""
    drawn = rng.normal(size=(count, len(deviations))) * deviations
    return drawn / np.linalg.norm(drawn, axis=1, keepdims=True)


class AngularCentralGaussian(Density, kind="angular-central-gaussian"):
    """The density of the directions of normal vectors with mean 0 (Tyler, 1987).

    Args:
        space: A sphere, a space of axes, or that of rotations, whose vectors are quaternions.
        matrix: Their covariance (p, p), of which only the ratios count.
    """

    article = "an angular central Gaussian density"
    stored = ("matrix",)

    def __init__(self, space: Space, matrix: Tensor) -> None:
        super().__init__(space)
        covariance = _symmetric(as_tensor(matrix, "matrix").detach().double(), space)
        values, axes = linalg.eigh(covariance.cpu())
        if not bool((values > 0).all()):
            raise OrbiflowError("the matrix must be positive definite")
        self.matrix = covariance
        self._inverse = ((axes / values) @ axes.mT).to(covariance)
        width = len(covariance)
        log_area = math.log(2) + width / 2 * math.log(math.pi) - math.lgamma(width / 2)
        self._log_top = math.log(images_of(space)) - log_area - float(values.log().sum()) / 2

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        del beside
        x = self.space.features(points.double())[0]
        square = ((x @ self._inverse) * x).sum(dim=-1)
        return (self._log_top - len(self.matrix) / 2 * square.log()).to(points)

    def bumps(self) -> Tensor:
        return self.space.from_features(linalg.eigh(self.matrix.cpu())[1].mT.contiguous())

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        rng = np.random.default_rng(int(torch.randint(2**31, (), generator=generator)))
        values, axes = np.linalg.eigh(self.matrix.cpu().numpy())
        drawn = central_gaussian(values**0.5, count, rng) @ axes.T
        return self.space.from_features(torch.tensor(drawn))


def _symmetric(matrix: Tensor, space: Space) -> Tensor:
    """Return a matrix (p, p) of a space of unit vectors of p numbers, once it is symmetric."""
    images_of(space)
    width = space.dim + 1
    if matrix.shape != (width, width) or not bool(matrix.isfinite().all()):
        raise OrbiflowError(f"the matrix must be {width} by {width} finite numbers")
    if not torch.allclose(matrix, matrix.mT, atol=1e-9 * float(matrix.abs().max())):
        raise OrbiflowError("the matrix must be symmetric")
    return (matrix + matrix.mT) / 2
