"""Known densities to draw from: on tori, the sphere, the Klein bottle and the projective plane."""

from __future__ import annotations

import math

import numpy as np
from common import ROOT
from density_data import Data, Drawn
from scipy.spatial.transform import Rotation
from scipy.special import ive, logsumexp

from orbiflow.density import to_latlon, to_vectors

STATES, KNOWN_ROWS = 4, 4_000
"""Of each angle of a hidden Markov chain; rows drawn of it."""

BUNDLED = ROOT / "examples" / "density"

COUNT = 10_000
"""Points of a synthetic set."""

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


def log_von_mises(data: Data, centers: Data, kappa: Data, weights: Data) -> Data:
    """Log of a mixture of products of von Mises distributions, (N,)."""
    terms = kappa * (np.cos(data[:, None] - centers) - 1) - np.log(2 * math.pi * ive(0, kappa))
    return np.asarray(logsumexp(terms.sum(axis=-1) + np.log(weights), axis=1))


def clusters(count: int, centers: Data, kappa: Data, weights: Data, seed: int) -> Drawn:
    """A mixture of von Mises distributions on a torus."""
    rng = np.random.default_rng(seed)
    chosen = rng.choice(len(weights), count, p=weights)
    data = rng.vonmises(centers[chosen], kappa[chosen])
    return Drawn(data, "torus", lambda x: log_von_mises(x, centers, kappa, weights))


def round_clusters(count: int) -> Drawn:
    """Three round ones on T2."""
    centers = np.array([[0.0, 0.0], [2.0, 1.0], [-1.5, 2.5]])
    kappa = np.array([20.0, 50.0, 8.0])[:, None] * np.ones(2)
    return clusters(count, centers, kappa, np.full(3, 1 / 3), 1)


def smooth() -> Drawn:
    """A low wave on T2."""

    def log_density(x: Data) -> Data:
        wave = np.cos(x[:, 0] + 2 * x[:, 1]) * np.sin(x[:, 1])
        return np.log1p(0.8 * wave) - math.log(4 * math.pi**2)

    rng = np.random.default_rng(2)
    points = rng.uniform(-np.pi, np.pi, (20_000, 2))
    kept = rng.uniform(size=len(points)) * 1.8 < np.exp(log_density(points)) * 4 * math.pi**2
    return Drawn(points[kept][:8_000], "torus", log_density)


def bananas() -> Drawn:
    """A curved band on T2, narrow across."""
    rng = np.random.default_rng(3)
    along = rng.vonmises(0.0, 1.5, 4_000)
    data = np.stack([along, rng.vonmises(np.sin(2 * along), 100.0)], axis=1)

    def log_density(x: Data) -> Data:
        first = log_von_mises(x[:, :1], np.zeros((1, 1)), np.array([[1.5]]), np.ones(1))
        off = (x[:, 1] - np.sin(2 * x[:, 0]))[:, None]
        return first + log_von_mises(off, np.zeros((1, 1)), np.array([[100.0]]), np.ones(1))

    return Drawn(data, "torus", log_density)


def checkerboard() -> Drawn:
    """The paper's, on T2."""
    rng = np.random.default_rng(4)
    points = rng.uniform(size=(20_000, 2))
    kept = np.floor(5 * points).sum(axis=1) % 2 == 0
    entropy = math.log(4 * math.pi**2 * 13 / 25)
    data = (2 * points[kept][:8_000] - 1) * np.pi
    return Drawn(data, "torus", lambda x: np.full(len(x), -entropy))


def ring() -> Drawn:
    """A narrow circle on the sphere, latitude and longitude."""
    rng = np.random.default_rng(5)
    z, lon = rng.normal(0.3, 0.03, 3_000), rng.uniform(0, 2 * np.pi, 3_000)
    across = np.sqrt(1 - z**2)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    vectors = np.stack([across * np.cos(lon), across * np.sin(lon), z], axis=1) @ turn

    def log_density(x: Data) -> Data:
        height = (x @ turn.T)[:, 2]
        scale = math.log(0.03 * math.sqrt(2 * math.pi)) + math.log(2 * math.pi)
        return -(((height - 0.3) / 0.03) ** 2) / 2 - scale

    return Drawn(vectors, "sphere", log_density)


def repeated() -> Drawn:
    """Half of the rows from forty places, the others from three clusters."""
    rng = np.random.default_rng(6)
    at = rng.uniform(-np.pi, np.pi, (40, 2))[rng.integers(40, size=1_500)]
    return Drawn(np.concatenate([at, round_clusters(1_500).data]), "torus")


def one_angle() -> Drawn:
    """A broad and a narrow one."""
    weights = np.array([0.6, 0.4])
    return clusters(600, np.array([[0.0], [2.0]]), np.array([[3.0], [80.0]]), weights, 7)


def hidden_markov_chain(dim: int) -> Drawn:
    """A hidden Markov chain of rotamers, of which the density is known.

    Each angle has one of `STATES` states, which depend on the state before; in a state it is von Mises
    about a mean that sways with the sine of the angle before. Its density is a sum over all paths.
    """
    rng = np.random.default_rng(dim)
    start = rng.dirichlet(np.full(STATES, 2.0))
    moves = rng.dirichlet(np.full(STATES, 0.7), (dim - 1, STATES))
    means = rng.uniform(-np.pi, np.pi, (dim, STATES))
    sway = rng.uniform(-0.6, 0.6, (dim, STATES))
    kappa = np.exp(rng.uniform(math.log(5), math.log(60), (dim, STATES)))

    state = rng.choice(STATES, KNOWN_ROWS, p=start)
    data = np.empty((KNOWN_ROWS, dim))
    for axis in range(dim):
        if axis:
            edges = moves[axis - 1].cumsum(axis=1)[state]
            state = (rng.uniform(size=(KNOWN_ROWS, 1)) > edges[:, :-1]).sum(axis=1)
        before = np.sin(data[:, axis - 1]) if axis else 0.0
        data[:, axis] = rng.vonmises(
            means[axis, state] + sway[axis, state] * before, kappa[axis, state]
        )

    def log_density(x: Data) -> Data:
        paths = np.log(start)[None]
        for axis in range(dim):
            if axis:
                paths = logsumexp(paths[:, :, None] + np.log(moves[axis - 1]), axis=1)
            before = np.sin(x[:, axis - 1]) if axis else np.zeros(len(x))
            off = x[:, axis, None] - means[axis] - sway[axis] * before[:, None]
            paths = paths + kappa[axis] * (np.cos(off) - 1)
            paths = paths - np.log(2 * math.pi * ive(0, kappa[axis]))
        return np.asarray(logsumexp(paths, axis=1))

    return Drawn(data, "torus", log_density)


def turned(components: int, count: int) -> Drawn:
    """Rotations (unit quaternions), and their log density in multiples of the uniform one.

    Wrapped normal distributions whose means are uniform and whose precisions are Gamma(100), as in De
    Bortoli et al., Riemannian score-based generative modelling (2022).
    """
    rng = np.random.default_rng(components)
    means = Rotation.random(components, rng=rng)
    deviations = rng.gamma(100, 1, components) ** -0.5
    chosen = rng.integers(components, size=count)
    steps = rng.normal(size=(count, 3)) * deviations[chosen, None]

    def log_density(rows: Data) -> Data:
        terms = []
        for mean, deviation in zip(means, deviations, strict=True):
            angle = (mean.inv() * Rotation.from_quat(rows)).magnitude()
            # a step of a whole turn more is 60 deviations long
            own = -((angle / deviation) ** 2) / 2 - 3 * np.log(deviation * np.sqrt(2 * np.pi))
            # the volume of steps over that of rotations, 8 pi^2 in all
            terms.append(own + np.log(8 * np.pi**2) - 2 * np.log(np.sinc(angle / 2 / np.pi)))
        return np.asarray(logsumexp(terms, axis=0)) - np.log(components)

    rows = (means[chosen] * Rotation.from_rotvec(steps)).as_quat()
    return Drawn(rows, "rotation-space", log_density)


def surface(name: str, space: str, count: int = 5_000) -> Drawn:
    """A set of the benchmark on unoriented surfaces, and its log density where that is known."""
    truth = {"three-circles": _log_circles, "three-axes": _log_axes}.get(name)
    return Drawn(unoriented(name)[:count], space, truth)


def unoriented(name: str) -> Data:
    """theta, phi (N, 2) in radians, or lat, lon (N, 2) in degrees, in the order of the splits."""
    match name:
        case "patches" | "poles":
            table = np.loadtxt(BUNDLED / f"{name}.csv", delimiter=",", skiprows=1)
            return table[:, :2]
        case "three-circles":
            return _draw_circles() % (2 * math.pi)
        case _:
            return _draw_axes()


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
