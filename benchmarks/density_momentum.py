"""The likelihood of kinetic diffusions on tori, as it is evaluated, where the answer is known.

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

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

Data = NDArray[np.float64]

TURNS = 2 * np.pi * np.arange(-6, 7)[:, None]


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
