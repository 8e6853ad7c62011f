"""Parametric families of densities of unit vectors: their log densities, starts and parameters.

A family has a frame of axes and a few shape parameters. In the frame's coordinates all but one are
exp(sum of a_i y_i + l_i y_i^2) / c, so that one constant serves them (`log_fisher_bingham`).

Sources: Mardia and Jupp, Directional Statistics (2000), chapters 9 and 13; Kent, The
Fisher-Bingham distribution on the sphere (1982); Tyler, Statistical analysis for the angular central
Gaussian distribution on the sphere (1987); Downs, Orientation statistics (1972); Prentice, Orientation
statistics without parametric assumptions (1986), for rotations as axes.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from itertools import combinations
from typing import NamedTuple

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.density.models import (
    AngularCentralGaussian,
    Density,
    FisherBingham,
    VonMisesSine,
    log_fisher_bingham,
    log_sine,
)
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import linalg

Planes = list[tuple[int, int]]
"""Pairs of axes: the frame may be turned in their planes."""

FLAT = 1e-13
"""A mean square along an axis, or a deviation, below which rows are the same but for rounding."""

TYLER_STEPS, TYLER_ERROR = 2_000, 1e-12
"""Steps of Tyler's iteration at most, and the relative change at which it ends."""


class Cloud:
    """Unit vectors (N, p) with weights (N,) of sum 1, and their moments."""

    def __init__(self, vectors: Tensor, weights: Tensor | None) -> None:
        self.vectors = vectors
        even = torch.full((len(vectors),), 1 / len(vectors), dtype=torch.float64)
        self.weights = even if weights is None else weights / weights.sum()
        self.mean = self.weights @ vectors
        self.tensor = (vectors * self.weights[:, None]).mT @ vectors

    @property
    def width(self) -> int:
        """The number of coordinates."""
        return self.vectors.shape[1]


class Start(NamedTuple):
    """A frame, whose rows (p, p) are the axes, and shape parameters (m,)."""

    frame: Tensor
    shape: Tensor


class Form(ABC):
    """A parametric family of densities of unit vectors.

    - `about`: Which rows it is for: "angles", "directions", "axes" or "rotations".
    - `positive`: Whether the reported shape parameters are, so that their intervals are of logarithms.
    - `bounds`: What the reported shape parameters are between.
    """

    name: str
    about: str = "axes"
    positive: bool = False
    bounds: tuple[float, float] = (-math.inf, math.inf)

    @abstractmethod
    def logs(self, shape: Tensor, y: Tensor) -> Tensor:
        """Return log densities (N,) per area of the whole sphere at vectors (N, p) in the frame."""

    @abstractmethod
    def starts(self, cloud: Cloud) -> list[Start]:
        """Return places from which to climb to the maximum of the likelihood."""

    @abstractmethod
    def density(self, space: Space, at: Start) -> Density:
        """Return the density of a frame and shape."""

    shape_names: tuple[str, ...] = ()
    """Names of the shape parameters as they are reported, unless there is one for each axis."""

    axis_names: tuple[str, ...] = ()
    """Names of the first axes of the frame, which are reported; unless all are, by number."""

    def names(self, width: int) -> tuple[str, ...]:
        """Return the names of the shape parameters as they are reported."""
        del width
        return self.shape_names

    def ordered(self, at: Start) -> Start:
        """Return the same density with its axes in their usual order."""
        return at

    def directions(self, width: int) -> list[tuple[str, int]]:
        """Return the names of the axes that are reported, each with its number in the frame."""
        names = self.axis_names or tuple(f"axis_{k + 1}" for k in range(width))
        return [(name, k) for k, name in enumerate(names)]

    def planes(self, width: int) -> Planes:
        """Return the planes in which turning the frame changes the density."""
        return list(combinations(range(width), 2))

    def reported(self, shape: Tensor, frame: Tensor) -> Tensor:
        """Return the shape parameters as they are reported."""
        del frame
        return shape

    def mean_log(self, shape: Tensor, frame: Tensor, cloud: Cloud) -> Tensor:
        """Return the mean log density of a cloud, differentiable."""
        return cloud.weights @ self.logs(shape, cloud.vectors @ frame.mT)


def _largest_first(at: Start) -> Start:
    """Return a frame and shape (p - 1,) of all axes but the first, which is the largest then."""
    values = torch.cat([at.shape.new_zeros(1), at.shape])
    order = values.argsort(descending=True)
    return Start(at.frame[order], values[order][1:] - values[order][0])


class ExponentialForm(Form):
    """A family exp(sum of a_i y_i + l_i y_i^2) / c: moments of the rows are all that it sees."""

    @abstractmethod
    def coefficients(self, shape: Tensor, width: int) -> tuple[Tensor, Tensor]:
        """Return the coefficients a and l (p,)."""

    def logs(self, shape: Tensor, y: Tensor) -> Tensor:
        vector, values = self.coefficients(shape, y.shape[1])
        return y @ vector + y**2 @ values - log_fisher_bingham(values, vector)

    def mean_log(self, shape: Tensor, frame: Tensor, cloud: Cloud) -> Tensor:
        vector, values = self.coefficients(shape, cloud.width)
        squares = ((frame @ cloud.tensor) * frame).sum(dim=1)
        exponent = vector @ (frame @ cloud.mean) + values @ squares
        return exponent - log_fisher_bingham(values, vector)

    def density(self, space: Space, at: Start) -> Density:
        vector, values = self.coefficients(at.shape, len(at.frame))
        return FisherBingham(space, vector @ at.frame, (at.frame.mT * values) @ at.frame)


def _along(*values: Tensor, width: int) -> Tensor:
    """Return a vector (width,) that begins with some numbers and goes on with zeros."""
    first = torch.stack(values)
    return torch.cat([first, first.new_zeros(width - len(first))])


def _completed(first: Tensor) -> Tensor:
    """Return an orthogonal matrix (p, p) whose first row is a unit vector (p,)."""
    basis = linalg.qr(torch.cat([first[:, None], torch.eye(len(first)).to(first)], dim=1))[0].mT
    return torch.cat([first[None], basis[1:]])


def _principal(cloud: Cloud) -> tuple[Tensor, Tensor]:
    """Return the eigenvalues (p,) of the orientation tensor, largest first, and its axes as rows."""
    values, axes = linalg.eigh(cloud.tensor)
    return values.flip(0), axes.mT.flip(0)


class VonMisesFisher(ExponentialForm):
    """exp(k m.x): directions about a mean."""

    name, about, positive = "von-mises-fisher", "directions", True
    shape_names, axis_names = ("concentration",), ("mean",)

    def planes(self, width: int) -> Planes:
        return [(0, k) for k in range(1, width)]

    def coefficients(self, shape: Tensor, width: int) -> tuple[Tensor, Tensor]:
        return _along(shape[0], width=width), shape.new_zeros(width)

    def starts(self, cloud: Cloud) -> list[Start]:
        length = linalg.vector_norm(cloud.mean)
        _refuse_if(float(length) < FLAT, "the rows have no mean direction")
        mean = cloud.mean / length
        # 1 - cos is half the square of the chord, which keeps its digits
        below = float(cloud.weights @ ((cloud.vectors - mean) ** 2).sum(dim=1)) / 2
        _refuse_if(below < FLAT, "all rows are the same direction")
        r = 1 - below
        kappa = r * (cloud.width - r * r) / (below * (1 + r))  # Banerjee and others, 2005
        return [Start(_completed(mean), torch.tensor([kappa], dtype=torch.float64))]


class Watson(ExponentialForm):
    """exp(k (m.x)^2): axes about one (k > 0) or across it (k < 0)."""

    name, shape_names, axis_names = "watson", ("concentration",), ("axis",)

    def planes(self, width: int) -> Planes:
        return [(0, k) for k in range(1, width)]

    def coefficients(self, shape: Tensor, width: int) -> tuple[Tensor, Tensor]:
        return shape.new_zeros(width), _along(shape[0], width=width)

    def starts(self, cloud: Cloud) -> list[Start]:
        squares, axes = _principal(cloud)
        _refuse_if(float(squares[0]) > 1 - FLAT, "all rows are the same axis")
        _refuse_if(float(squares[-1]) < FLAT, "the rows lie in a plane through the origin")
        width = cloud.width
        starts: list[Start] = []
        for end in (0, -1):
            s = squares[end]
            # a bound of Sra and Karp, The multivariate Watson distribution (2013)
            guess = (width * s - 1) / (2 * s * (1 - s)) * (1 + (1 - s) * 2 / (width - 1))
            starts.append(Start(_completed(axes[end]), guess[None]))
        return starts


class Bingham(ExponentialForm):
    """exp(sum of k_i (e_i.x)^2) with 0 = k_1 >= k_2 >= ...: axes about a point, or along a girdle."""

    name, bounds = "bingham", (-math.inf, 0.0)

    def names(self, width: int) -> tuple[str, ...]:
        return tuple(f"concentration_{k}" for k in range(2, width + 1))

    def coefficients(self, shape: Tensor, width: int) -> tuple[Tensor, Tensor]:
        return shape.new_zeros(width), torch.cat([shape.new_zeros(1), shape])

    def ordered(self, at: Start) -> Start:
        return _largest_first(at)

    def starts(self, cloud: Cloud) -> list[Start]:
        squares, axes = _principal(cloud)
        _refuse_if(float(squares[-1]) < FLAT, "the rows lie in a plane through the origin")
        return [Start(axes, 1 / (2 * squares[:1]) - 1 / (2 * squares[1:]))]


def _quaternion_tensors() -> Tensor:
    """Return matrices B (9, 4, 4) for which a rotation's entries, row by row, are q.Bq."""
    tensors, unit = np.zeros((9, 4, 4)), np.eye(4)
    for i, j in combinations(range(4), 2):
        some = np.stack([unit[i], unit[j], unit[i] + unit[j]])  # quaternions of any length
        first, other, both = Rotation.from_quat(some).as_matrix().reshape(3, 9)
        tensors[:, i, i], tensors[:, j, j] = first, other
        tensors[:, i, j] = tensors[:, j, i] = both - (first + other) / 2
    return torch.tensor(tensors)


class MatrixFisher(Bingham):
    """exp(trace(F'R)): rotations about a mean, as a Bingham density of quaternions."""

    name, about, axis_names = "matrix-fisher", "rotations", ("mean",)
    bounds = (-math.inf, math.inf)

    def names(self, width: int) -> tuple[str, ...]:
        entries = tuple(f"f{i}{j}" for i in "123" for j in "123")
        return (*(f"singular_{k}" for k in range(1, width)), *entries)

    def reported(self, shape: Tensor, frame: Tensor) -> Tensor:
        values = torch.cat([shape.new_zeros(1), shape])
        values = values - values.mean()  # as the trace of a sum of rotations has none
        matrix = (frame.mT * values) @ frame
        entries = (_quaternion_tensors() * matrix).sum(dim=(1, 2)) / 4
        return torch.cat([(values[0] + values[1:]) / 2, entries])


class Kent(ExponentialForm):
    """exp(k m.x + b ((e_2.x)^2 - (e_3.x)^2)): directions about a mean, with ovals as contours."""

    name, about, bounds = "kent", "directions", (0.0, math.inf)
    shape_names, axis_names = ("concentration", "ovalness"), ("mean", "major", "minor")

    def coefficients(self, shape: Tensor, width: int) -> tuple[Tensor, Tensor]:
        kappa, beta = shape
        none = shape.new_zeros(())
        return _along(kappa, width=width), torch.stack([none, beta, -beta])

    def ordered(self, at: Start) -> Start:
        if float(at.shape[1]) >= 0:
            return at
        return Start(at.frame[[0, 2, 1]], at.shape * at.shape.new_tensor([1.0, -1.0]))

    def starts(self, cloud: Cloud) -> list[Start]:
        ((frame, (kappa,)),) = VonMisesFisher().starts(cloud)
        across = frame[1:] @ cloud.tensor @ frame[1:].mT
        squares, axes = linalg.eigh(across)
        _refuse_if(float(squares[0]) < FLAT, "the rows lie on a great circle")
        turned = torch.cat([frame[:1], axes.mT.flip(0) @ frame[1:]])
        # that of normal directions, with some room to 2 b = k
        beta = 0.25 * (1 / squares[0] - 1 / squares[1])
        kappa = torch.maximum(kappa, 2.2 * beta)
        return [Start(turned, torch.stack([kappa, beta]))]


class VonMisesSineForm(Form):
    """exp(k cos a + l cos b + d sin a sin b): two angles, as the vector of their cosines and sines."""

    name, about = "von-mises-sine", "angles"
    shape_names = ("concentration_1", "concentration_2", "dependence")

    def directions(self, width: int) -> list[tuple[str, int]]:
        del width
        return [("mean", 0), ("mean", 2)]

    def planes(self, width: int) -> Planes:
        del width
        return [(0, 1), (2, 3)]

    def logs(self, shape: Tensor, y: Tensor) -> Tensor:
        exponent = shape[0] * y[:, 0] + shape[1] * y[:, 2] + shape[2] * y[:, 1] * y[:, 3]
        return exponent - log_sine(shape)

    def mean_log(self, shape: Tensor, frame: Tensor, cloud: Cloud) -> Tensor:
        mean, both = frame @ cloud.mean, frame[1] @ cloud.tensor @ frame[3]
        return shape @ torch.stack([mean[0], mean[2], both]) - log_sine(shape)

    def starts(self, cloud: Cloud) -> list[Start]:
        frame = torch.zeros(4, 4, dtype=torch.float64)
        kappas: list[Tensor] = []
        for k in (0, 2):
            side = Cloud(cloud.vectors[:, k : k + 2], cloud.weights)
            ((axes, (kappa,)),) = VonMisesFisher().starts(side)
            x, y = axes[0]
            frame[k : k + 2, k : k + 2] = torch.stack([x, y, -y, x]).reshape(2, 2)
            kappas.append(kappa)
        return [Start(frame, torch.stack([*kappas, torch.zeros_like(kappas[0])]))]

    def density(self, space: Space, at: Start) -> Density:
        turns = [torch.atan2(at.frame[k, k + 1], at.frame[k, k]) / (2 * math.pi) for k in (0, 2)]
        means = space.project(torch.stack(turns)[None])[0]
        return VonMisesSine(space, means, at.shape)


class CentralGaussian(Form):
    """The directions of normal vectors with mean 0: axes, with heavier tails than Bingham's."""

    name, positive = "angular-central-gaussian", True

    def names(self, width: int) -> tuple[str, ...]:
        return tuple(f"eigenvalue_{k}" for k in range(1, width + 1))

    def logs(self, shape: Tensor, y: Tensor) -> Tensor:
        width = y.shape[1]
        values = torch.cat([shape.new_zeros(1), shape])
        area = math.log(2) + width / 2 * math.log(math.pi) - math.lgamma(width / 2)
        return -values.sum() / 2 - width / 2 * (y**2 @ (-values).exp()).log() - area

    def reported(self, shape: Tensor, frame: Tensor) -> Tensor:
        del frame
        return torch.softmax(torch.cat([shape.new_zeros(1), shape]), dim=0)

    def starts(self, cloud: Cloud) -> list[Start]:
        squares, _ = _principal(cloud)
        _refuse_if(float(squares[-1]) < FLAT, "the rows lie in a plane through the origin")
        width, x = cloud.width, cloud.vectors
        matrix = cloud.tensor
        for _ in range(TYLER_STEPS):
            square = (linalg.solve(matrix, x.mT).mT * x).sum(dim=1)
            new = (x * (cloud.weights / square)[:, None]).mT @ x
            new = new / new.trace()
            done = float((new - matrix).abs().max()) < TYLER_ERROR
            matrix = new
            if done:
                break
        values, axes = linalg.eigh(matrix)
        _refuse_if(float(values[0]) < FLAT, f"more than a {width}th of the rows lie in a plane")
        logs = values.flip(0).log()
        return [Start(axes.mT.flip(0), logs[1:] - logs[0])]

    def ordered(self, at: Start) -> Start:
        return _largest_first(at)

    def density(self, space: Space, at: Start) -> Density:
        values = torch.cat([at.shape.new_zeros(1), at.shape]).exp()
        return AngularCentralGaussian(space, (at.frame.mT * values) @ at.frame)


def _refuse_if(wrong: bool, why: str) -> None:
    if wrong:
        raise OrbiflowError(f"{why}: such a density cannot be fitted")


FORMS: dict[str, Form] = {
    form.name: form
    for form in (
        VonMisesFisher(),
        Watson(),
        Bingham(),
        Kent(),
        CentralGaussian(),
        MatrixFisher(),
        VonMisesSineForm(),
    )
}
"""The families of unit vectors, by name."""
