"""What a test log-likelihood can be: without limit where rows repeat, else as the entropy allows."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from density_kde import KernelDensity
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import digamma, gammaln

from orbiflow.density import to_vectors

Data = NDArray[np.float64]

FAR = 40.0
"""Where a narrow kernel ends: its logarithm is smaller than its peak's by this."""

SHARES = (0.0, 0.001, 0.01, 0.03, 0.1, 0.2, 0.4)
"""Of narrow kernels, to be chosen on rows held out."""


def embedded(data: Data, round_: bool) -> Data:
    """Points whose squared chord is twice 1 - cos of the angle, or the sum of those of the angles."""
    if round_:
        return to_vectors(data)
    return np.concatenate([np.cos(data), np.sin(data)], axis=1)


def narrow_log_density(train: Data, test: Data, kappa: float, *, round_: bool) -> Data:
    """Log of a kernel estimate of a concentration so great that kernels are normal and see few rows.

    Distances are differences of coordinates: cosines would lose what is nearer than 1e-8.
    """
    tree = KDTree(embedded(train, round_))
    places = embedded(test, round_)
    if round_:
        log_normal = math.log(2 * math.pi / kappa)
    else:
        log_normal = train.shape[1] / 2 * math.log(2 * math.pi / kappa)
    near = tree.query_ball_point(places, math.sqrt(2 * FAR / kappa))
    found = np.full(len(test), -np.inf)
    for at, rows in enumerate(near):
        if rows:
            chords = ((tree.data[rows] - places[at]) ** 2).sum(axis=1)
            found[at] = np.logaddexp.reduce(-kappa * chords / 2)
    return found - log_normal - math.log(len(train))


def with_narrow(
    train: Data, held: Data, test: Data, kappas: Data, *, round_: bool
) -> tuple[float, list[tuple[float, float]]]:
    """Test NLL of a tuned kernel estimate, and with narrow kernels added: (NLL, their share) for each.

    The share is that of `SHARES` which suits the rows held out best.
    """
    broad = KernelDensity.tuned(train, held, round_=round_)
    base = [broad.score_samples(part) for part in (held, test)]
    found = []
    for kappa in kappas:
        narrow = [narrow_log_density(train, part, kappa, round_=round_) for part in (held, test)]

        def nll(share: float, own: int, narrow: list[Data] = narrow) -> float:
            if not share:
                return -float(base[own].mean())
            both = np.logaddexp(math.log1p(-share) + base[own], math.log(share) + narrow[own])
            return -float(both.mean())

        best = min(SHARES, key=lambda share: nll(share, 0))
        found.append((nll(best, 1), best))
    return -float(base[1].mean()), found


def neighbour_entropy(data: Data, neighbour: int = 1) -> float:
    """Differential entropy, in nats, of angles (N, d): Kozachenko and Leonenko (1987).

    From the distance to the nearest row on the torus; rows must differ.
    """
    count, dim = data.shape
    turned = np.remainder(data, 2 * np.pi)
    period: Any = 2 * np.pi * (1 + 1e-12)
    distance = np.asarray(KDTree(turned, boxsize=period).query(turned, k=neighbour + 1)[0])
    ball = dim / 2 * math.log(math.pi) - gammaln(dim / 2 + 1)
    mean = float(np.log(distance[:, neighbour]).mean())
    return float(digamma(count) - digamma(neighbour) + ball + dim * mean)
