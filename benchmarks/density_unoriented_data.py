"""The four data sets of the benchmark on unoriented surfaces, and their known densities."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from common import ROOT
from density_data import Data

from orbiflow.density import to_latlon, to_vectors

BUNDLED = ROOT / "examples" / "density"

COUNT = 10_000
"""Points of a synthetic set."""

KLEIN = ("patches", "three-circles")
AXES = ("poles", "three-axes")

CIRCLES = np.array(
    [  # weight, mean and standard deviation of theta, of phi; inf: uniform
        [0.6, 0.0, np.inf, 0.0, 0.3],
        [0.2, 0.0, 0.15, 0.0, np.inf],
        [0.2, math.pi / 2, 0.15, 0.0, np.inf],
    ]
)
"""Wrapped normal distributions on the torus, of which the Klein bottle is a quotient."""

SHAPES = (
    (0.4, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 400.0))),
    (0.3, ((400.0, 0.0, 0.0), (0.0, 200.0, 199.0), (0.0, 199.0, 200.0))),
    (0.3, ((40.0, 38.0, 0.0), (38.0, 40.0, 0.0), (0.0, 0.0, 1.0))),
)
"""Weights and covariances of central Gaussians, whose directions are the axes (Tyler, Biometrika 74,
1987): a cluster about z, a girdle, a long cluster about x = y."""


class Known(NamedTuple):
    """A density that is known: its entropy in nats, and how to evaluate it."""

    entropy: float
    name: str

    def log_density(self, data: Data) -> Data:
        """Log densities (N,), per radian^2 of theta, phi or per steradian."""
        return _log_circles(data) if self.name == "three-circles" else _log_axes(data)


def load(name: str) -> Data:
    """theta, phi (N, 2) in radians, or lat, lon (N, 2) in degrees, in the order of the splits."""
    match name:
        case "patches" | "poles":
            table = np.loadtxt(BUNDLED / f"{name}.csv", delimiter=",", skiprows=1)
            return table[:, :2]
        case "three-circles":
            return _draw_circles()
        case _:
            return _draw_axes()


def known(name: str) -> Known | None:
    """The true density of a synthetic set, with its entropy by quadrature."""
    if name == "three-circles":
        t = (np.arange(800) + 0.5) * math.pi / 800
        grid = np.stack(np.meshgrid(t, 2 * t, indexing="ij"), axis=-1).reshape(-1, 2)
        log, area = _log_circles(grid), np.full(len(grid), 2 * (math.pi / 800) ** 2)
    elif name == "three-axes":
        nodes, weights = np.polynomial.legendre.leggauss(800)
        lon = np.arange(800) * 0.225  # half the sphere is all axes
        lat = np.degrees(np.arcsin(nodes))
        grid = np.stack(np.meshgrid(lat, lon, indexing="ij"), axis=-1).reshape(-1, 2)
        log, area = _log_axes(grid.astype(np.float64)), np.repeat(weights, 800) * math.pi / 800
    else:
        return None
    mass = float((np.exp(log) * area).sum())
    assert abs(mass - 1) < 1e-6, (name, mass)
    return Known(-float((np.exp(log) * log * area).sum()), name)


def _draw_circles() -> Data:
    rng = np.random.default_rng(0)
    part = rng.choice(3, COUNT, p=CIRCLES[:, 0])
    normal, turn = rng.standard_normal((COUNT, 2)), rng.random((COUNT, 2))
    mean, spread = CIRCLES[part][:, [1, 3]], CIRCLES[part][:, [2, 4]]
    around = mean + np.where(np.isinf(spread), 0.0, spread) * normal
    return np.where(np.isinf(spread), 2 * math.pi * turn, around)


def _log_circles(data: Data) -> Data:
    theta, phi = data.T
    images = np.stack([data, np.stack([theta + math.pi, math.pi - phi], axis=1)])
    total = np.zeros(len(data))
    for weight, *moments in CIRCLES:
        factors = (
            _wrapped_normal(images[..., k], moments[2 * k], moments[2 * k + 1]) for k in range(2)
        )
        total += weight * math.prod(factors).sum(axis=0)  # type: ignore[attr-defined]
    return np.log(total)


def _wrapped_normal(angle: Data, mean: float, spread: float) -> Data:
    if math.isinf(spread):
        return np.full_like(angle, 1 / (2 * math.pi))
    distance = np.remainder(angle - mean + math.pi, 2 * math.pi) - math.pi
    turns = 2 * math.pi * np.arange(-2, 3)[:, None, None]
    terms = np.exp(-0.5 * ((distance + turns) / spread) ** 2)
    return terms.sum(axis=0) / (spread * math.sqrt(2 * math.pi))


def _draw_axes() -> Data:
    rng = np.random.default_rng(0)
    part = rng.choice(3, COUNT, p=[weight for weight, _ in SHAPES])
    normal = rng.standard_normal((COUNT, 3))
    roots = np.stack([np.linalg.cholesky(np.array(shape)) for _, shape in SHAPES])
    vectors = np.einsum("nij,nj->ni", roots[part], normal)
    return to_latlon(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


def _log_axes(data: Data) -> Data:
    vectors, total = to_vectors(data), np.zeros(len(data))
    for weight, shape in SHAPES:
        covariance = np.array(shape)
        form = np.einsum("ni,ij,nj->n", vectors, np.linalg.inv(covariance), vectors)
        total += weight * form**-1.5 / math.sqrt(np.linalg.det(covariance))
    return np.log(total / (2 * math.pi))
