"""Published test log-likelihoods beside ours, and what each can be worth (docs/published.md).

    python benchmarks/density_record.py [--splits K] [--workers W] [--quick] [PART ...]

table: ours on each data set, random 90/10 splits and grouped ones (equal locations; protein chains;
RNA structures), with the integral of every density by quadrature (density_integral.py), and the
published figures. narrow: test NLL of a tuned kernel estimate with ever narrower kernels added, on
both kinds of split. entropy: what an estimate by nearest neighbours says of the data's entropy, and
of that of as many draws from our density, whose entropy is known. Needs the tables of
docs/benchmarks.md.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from typing import NamedTuple

import numpy as np
import torch
from common import published
from density_data import EARTH, TORI, Data, Drawn, backbone_and_chains, earth, rna_angles
from density_default import halves
from density_integral import Integral, integral
from density_limits import neighbour_entropy, with_narrow
from numpy.typing import NDArray

from orbiflow.density import DensityEstimator, Mixture

SETS = (*EARTH, *TORI, "rna")
PUBLISHED_NAME = {"quakes": "earthquake"}
METHODS = ("moser", "rsgm", "rdm", "rfm", "gfm", "tdm", "wkbc")


def load(name: str) -> Drawn:
    """A data set of the record, with the group of each row: its place, protein chain or structure."""
    if name == "rna":
        return rna_angles()
    if name in EARTH:
        rows, space = earth(name), "sphere"
        _, group = np.unique(rows, axis=0, return_inverse=True)
    else:
        (rows, chain), space = backbone_and_chains(name), "torus"
        _, group = np.unique(chain, return_inverse=True)
    return Drawn(rows, space, group=group.ravel())


class Row(NamedTuple):
    """Of one split: test NLL, share of test rows that repeat a training row, the density's integral."""

    nll: float
    repeated: float
    integral: Integral


def fitted(name: str, seed: int, grouped: bool) -> tuple[DensityEstimator, Data, Data]:
    """The default, and the training and test rows."""
    drawn = load(name)
    train, test = halves(drawn, seed, drawn.group if grouped else None)
    repeats = "rounding" if grouped and name in EARTH else "places"
    return DensityEstimator(drawn.space, seed=seed, repeats=repeats).fit(train), train, test


def row(job: tuple[str, int, bool]) -> Row:
    """One split."""
    torch.set_num_threads(1)
    estimator, train, test = fitted(*job)
    known = set(map(bytes, train))
    density = estimator.density_
    assert isinstance(density, Mixture)
    return Row(
        -estimator.score(test),
        float(np.mean([bytes(place) in known for place in test])),
        integral(density),
    )


def table(count: int, pool: ProcessPoolExecutor, names: tuple[str, ...]) -> None:
    """Print ours beside the published figures."""
    figures = published("density_nll")
    print(f"{count} splits: ours, mean and spread; test rows that repeat a training row; integrals")
    print(
        f"{'data':9}{'random':>17}{'repeat':>8}{'grouped':>17}"
        + "".join(f"{m:>8}" for m in METHODS)
    )
    jobs = [
        (name, seed, grouped)
        for name in names
        for grouped in (False, True)
        for seed in range(count)
    ]
    found = pool.map(row, jobs)
    for name in names:
        random, grouped = ([next(found) for _ in range(count)] for _ in range(2))
        others = [figures.get(m, {}).get(PUBLISHED_NAME.get(name, name), math.nan) for m in METHODS]
        print(
            f"{name:9}{_spread(random)}{np.mean([r.repeated for r in random]):8.1%}{_spread(grouped)}"
            + "".join(f"{value:8.2f}" if math.isfinite(value) else f"{'':8}" for value in others)
        )
        for what, rows in (("random", random), ("grouped", grouped)):
            whole = "  ".join(f"{r.integral.value:.5f} ({r.integral.worst:.0e})" for r in rows)
            print(f"{'':9}integral, {what}: {whole}", flush=True)


def _spread(rows: list[Row]) -> str:
    values = [r.nll for r in rows]
    return f"{np.mean(values):9.3f} +- {np.std(values):.3f}"


def narrow(_count: int, _pool: ProcessPoolExecutor, names: tuple[str, ...]) -> None:
    """Print test NLL by the width of added kernels."""
    kappas = np.array([1e5, 1e7, 1e9, 1e11, 1e13])
    print("test NLL of a kernel estimate, and with kernels of these deviations added (their share)")
    print(f"{'data':9}{'split':9}{'tuned':>8}" + "".join(f"{_width(k):>16}" for k in kappas))
    for name in names:
        drawn = load(name)
        for what in ("random", "grouped"):
            rest, test = halves(drawn, 0, drawn.group if what == "grouped" else None)
            own = _groups(drawn, rest) if what == "grouped" else None
            train, held = halves(Drawn(rest, drawn.space), 1, own)
            base, found = with_narrow(train, held, test, kappas, round_=drawn.space == "sphere")
            cells = "".join(f"{nll:9.3f} ({share:4.1%})" for nll, share in found)
            print(f"{name:9}{what:9}{base:8.3f}{cells}", flush=True)


def _groups(drawn: Drawn, rows: Data) -> NDArray[np.integer]:
    """The group of each of some rows, by their values: those that are equal share one."""
    assert drawn.group is not None
    own = {bytes(place): number for place, number in zip(drawn.data, drawn.group, strict=True)}
    return np.array([own[bytes(place)] for place in rows])


def _width(kappa: float) -> str:
    degrees = math.degrees(kappa**-0.5)
    return f"{degrees:.1g} deg" if degrees > 1e-3 else f"{degrees:.0e} deg"


def entropy(_count: int, _pool: ProcessPoolExecutor, names: tuple[str, ...]) -> None:
    """Print estimates of the entropy of data on tori, by nearest, second and fourth neighbours."""
    print("entropy by neighbours, of the rows and of as many draws from our density, which has the")
    print(
        f"{'data':9}{'rows':>8}{'true':>9}{'neighbour':>11}{'of rows':>9}{'draws':>9}{'corrected':>11}"
    )
    for name in names:
        drawn = load(name)
        if drawn.space != "torus":
            continue
        torch.set_num_threads(1)
        parts = "mixture,chains"  # smooth: draws from kernels lie beside each other
        estimator = DensityEstimator("torus", seed=0, components=parts).fit(drawn.data)
        draws = estimator.sample(len(drawn.data), random_state=1)
        truth = -estimator.score(draws)
        for neighbour in (1, 2, 4):
            own, other = (neighbour_entropy(part, neighbour) for part in (drawn.data, draws))
            cells = f"{truth:9.3f}{neighbour:11}{own:9.3f}{other:9.3f}{own - other + truth:11.3f}"
            print(f"{name:9}{len(drawn.data):8}{cells}", flush=True)


PARTS: dict[str, Callable[[int, ProcessPoolExecutor, tuple[str, ...]], None]] = {
    "narrow": narrow,
    "entropy": entropy,
    "table": table,
}


def main() -> None:
    """Print the parts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(PARTS)} (all)")
    parser.add_argument("--data", nargs="+", choices=SETS, default=list(SETS))
    parser.add_argument("--splits", type=int, default=2)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="proline, one split")
    options = parser.parse_args()
    if unknown := set(options.parts) - set(PARTS):
        parser.error(f"no such part: {', '.join(sorted(unknown))}")
    names = ("proline",) if options.quick else tuple(options.data)
    parts = options.parts or (["narrow", "table"] if options.quick else list(PARTS))
    for name in names:
        load(name)  # what is missing is said here, once
    with ProcessPoolExecutor(options.workers) as pool:
        for part in parts:
            PARTS[part](1 if options.quick else options.splits, pool, names)
            print()


if __name__ == "__main__":
    main()
