"""What a test log-likelihood can be: without limit where rows repeat, else as the entropy allows.

And what a published evaluation makes of one where the answer is known.
TDM (Zhu et al., ICLR 2025) adds a velocity xi to each angle g: dg = xi dt, dxi = -xi dt + sqrt(2)
dW. Its published code (github.com/yuchen-zhu-zyc/TDM, losses.py and sde.py) scores a test row by
following the probability flow from t0 to T in fixed steps,

    xi <- exp(-dt) xi - (1 - exp(-dt)) score,    g <- g + dt xi,

adding up the divergence -1 - d score / d xi at the start of each; the log density is that sum + log
N(xi_T) - log N(xi_0) - log 2 pi for each angle. Here the rows are wrapped normal: the score is
known and so is the log density; what is estimated can be integrated.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from density_kde import KernelDensity
from numpy.typing import NDArray
from scipy.spatial import KDTree
from scipy.special import digamma, gammaln, logsumexp

from orbiflow.density import to_vectors

Data = NDArray[np.float64]

FAR = 40.0
"""Where a narrow kernel ends: its logarithm is smaller than its peak's by this."""

SHARES = (0.0, 0.001, 0.01, 0.03, 0.1, 0.2, 0.4)
"""Of narrow kernels, to be chosen on rows held out."""

TURNS = 2 * np.pi * np.arange(-6, 7)[:, None]


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


def log_wrapped(angle: Data, deviation: float) -> Data:
    """Log density of the wrapped normal about 0."""
    terms = -((angle + TURNS) ** 2) / (2 * deviation**2)
    return np.asarray(logsumexp(terms, axis=0)) - math.log(deviation * math.sqrt(2 * math.pi))


def score(time: float, angle: Data, velocity: Data, deviation: float) -> tuple[Data, Data]:
    """d log p_t / d xi, exact, and its derivative by xi.

    p_t is a sum of normals over the angle's turns: of variance s^2 + 2 (t - 1 + e^-t) in the angle, 1
    in the velocity and covariance 1 - e^-t.
    """
    left = 1 - math.exp(-time)
    variance = deviation**2 + 2 * (time - left)
    spread = 1 - left**2 / variance
    lifted = angle + TURNS
    off = velocity - left * lifted / variance
    logs = -(lifted**2) / (2 * variance) - off**2 / (2 * spread)
    weights = np.exp(logs - np.asarray(logsumexp(logs, axis=0)))
    pull = -off / spread
    mean = (weights * pull).sum(axis=0)
    return mean, (weights * pull**2).sum(axis=0) - mean**2 - 1 / spread


def estimated(
    angle: Data, deviation: float, steps: int, *, end: float, start: float, seed: int = 0
) -> Data:
    """Log densities (N,) at angles, as the scheme has them with the exact score."""
    velocity = np.random.default_rng(seed).normal(size=len(angle))
    first, total, dt = velocity, np.zeros(len(angle)), end / steps
    for time in np.linspace(start, end, steps):
        mean, slope = score(time, angle, velocity, deviation)
        total = total - (1 + slope) * (end - start) / steps
        velocity = math.exp(-dt) * velocity - (1 - math.exp(-dt)) * mean
        angle = np.remainder(angle + dt * velocity + np.pi, 2 * np.pi) - np.pi
    return total + (first**2 - velocity**2) / 2 - math.log(2 * math.pi)


def excess(deviation: float, steps: int, *, end: float, start: float, rows: int) -> float:
    """Estimated less true NLL, nats an angle."""
    angle = np.random.default_rng(1).normal(0, deviation, rows)
    own = estimated(angle, deviation, steps, end=end, start=start)
    return float((log_wrapped(angle, deviation) - own).mean())


def mass(deviation: float, steps: int, *, end: float, start: float, draws: int = 100) -> float:
    """Integral over the angle of exp of the mean log density that the scheme estimates there."""
    reach, count = min(math.pi, 8 * deviation), 200
    grid = reach * (2 * np.arange(count) + 1 - count) / count
    own = estimated(np.repeat(grid, draws), deviation, steps, end=end, start=start)
    return float(np.exp(own.reshape(count, draws).mean(axis=1)).sum() * 2 * reach / count)
