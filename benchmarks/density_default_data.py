"""The data sets of the benchmark of defaults: real ones, and synthetic ones of known density."""

from __future__ import annotations

import csv
import math
from collections.abc import Callable
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from common import DATA, needed
from density_data import Data, backbone, earth, poles
from density_unoriented_data import known
from density_unoriented_data import load as unoriented
from scipy.special import ive, logsumexp

Log = Callable[[Data], Data]


class Drawn(NamedTuple):
    """Rows, their space, their log density where it is known; rows to train on, default nine tenths."""

    data: Data
    space: str
    log_density: Log | None = None
    trained: int | None = None


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


def rotamers(name: str, angles: int, count: int) -> Drawn:
    """Backbone and side-chain angles of the Top8000 proteins, in radians."""
    path = needed(DATA / "density/torus/top8000" / f"rota8000-{name}.csv", "the rotamers")
    rows = []
    with path.open() as file:
        for row in csv.reader(file):
            try:
                rows.append([float(cell) for cell in row[1 : 1 + angles]])
            except ValueError:  # a missing angle
                continue
    order = np.random.default_rng(8).permutation(len(rows))[:count]
    return Drawn(np.radians(np.array(rows))[order], "torus")


def surface(name: str, space: str) -> Drawn:
    """A set of the benchmark on unoriented surfaces."""
    truth = known(name)
    return Drawn(unoriented(name)[:5_000], space, truth.log_density if truth else None)


SETS: dict[str, Callable[[], Drawn]] = {
    "tiny": lambda: round_clusters(1_000)._replace(trained=30),
    "clusters": lambda: round_clusters(3_000),
    "rounded": lambda: Drawn(np.round(round_clusters(2_000).data, 1), "torus"),
    "repeated": repeated,
    "one-angle": one_angle,
    "smooth": smooth,
    "bananas": bananas,
    "checkerboard": checkerboard,
    "ring": ring,
    "circles": lambda: surface("three-circles", "klein-bottle"),
    "patches": lambda: surface("patches", "klein-bottle"),
    "axes": lambda: surface("three-axes", "projective-plane"),
    "poles": lambda: Drawn(poles(), "projective-plane"),
    "quakes": lambda: Drawn(earth("quakes"), "sphere"),
    "fire": lambda: Drawn(earth("fire"), "sphere"),
    "prepro": lambda: Drawn(backbone("prepro"), "torus"),
    "glycine": lambda: Drawn(backbone("glycine"), "torus"),
    "his-3": lambda: rotamers("his", 3, 4_000),
    "gln-5": lambda: rotamers("gln", 5, 3_000),
}


@lru_cache(maxsize=2)
def load(name: str) -> Drawn:
    """One of `SETS`."""
    return SETS[name]()
