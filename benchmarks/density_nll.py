"""Test log-likelihoods of the default beside other densities, on the same splits of the same rows.

    python benchmarks/density_nll.py [--sets general,fire,...] [--methods orbiflow,zuko,...] [--quick]
        [--splits 2] [--workers 2] [--device cuda --device-workers 4] [--out nll.jsonl]
    python benchmarks/density_nll.py --show nll.jsonl
    pip install zuko normflows flowjax scikit-learn bvvmmm    # for --methods all

Each fit is a line of `--out` as soon as it has ended, and a run leaves out what is there. `--show`
prints tables: the mean negative log density of test rows in nats (per radian^d, per steradian, or for
rotations above the uniform density), its spread over the splits, seconds, and the integral. Splits are
80 % to train, 10 % to choose by, 10 % to test; of sets called "apart", rows of one place are on one
side. Flows have two sizes, of which the one that is better on
the held-out rows counts, with the seconds of both. The default takes the held-out rows as training
rows, because it holds rows out by itself. Each fit has one thread, and flows of the larger size may
have the device.

Integrals are means of p / q at draws of q: a tenth is uniform, the rest kernels about training rows, as
wide as they are apart and of five widths, less what their linear relation to the parts of q, whose
integrals are known, says of the draws. Their standard error is given. Those of the default are
quadratures (density_integral.py) where that can be, because kernels about repeated rows are too narrow
for draws.

The methods are the default, one kernel width and one mixture that are best on the held-out rows (both
with a hundredth of the uniform density), and those of rivals.py.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rivals
import torch
from density_data import EARTH, MORE_EARTH, TORI, Data, earth, sidechains, splits
from density_integral import integral
from density_kde import KernelDensity
from density_known import turned
from density_record import load

from orbiflow.density import (
    AdaptiveKernels,
    DensityEstimator,
    Mixture,
    Space,
    UniformDensity,
    make_space,
    to_vectors,
)
from orbiflow.density.fitting.kernels import even_kernels, fit_mixture, kernel_estimates, spreads
from orbiflow.density.fitting.rows import Rows

APART = tuple(f"{name}-apart" for name in (*EARTH, *MORE_EARTH))
SIDES = ("side3", "side4", "side5", "side6", "side7")
ROTATIONS = ("so3-16", "so3-32", "so3-64")
SETS = (*EARTH, *MORE_EARTH, *APART, *TORI, *SIDES, "rna", *ROTATIONS)
FLOWS = {"zuko": rivals.zuko, "normflows": rivals.normflows, "flowjax": rivals.flowjax}
OWN = ("orbiflow", "kernels", "mixture", "sklearn", "bvvmmm")
METHODS = (*OWN, *FLOWS)

ROTATION_ROWS, MIXTURE_SIZES = 10_000, (1, 2, 4, 8, 16, 32, 64, 128)
DRAWS, CENTERS, DRAWN_KAPPAS = 40_000, 12_000, (0.7, 4.0, 30.0, 1e3, 1e7)

Log = Callable[[Data], Data]


class Job(NamedTuple):
    """One fit: the size is of a flow, 0 for others."""

    set: str
    split: int
    method: str
    size: int
    device: str


class Part(NamedTuple):
    """A split of a set, and its true log density where that is known."""

    space: str
    train: Data
    held: Data
    test: Data
    truth: Log | None


def part_of(name: str, split: int) -> Part:
    """The rows of a set, by a split's number."""
    truth: Log | None = None
    if name.startswith("so3-"):
        data, space, truth, *_ = turned(int(name[4:]), ROTATION_ROWS)
    elif name.startswith("side"):
        dim = int(name[4:])
        # there is none of three angles: two of the backbone and the first of the side chain
        data, space = sidechains(max(dim, 4)).data[:, :dim], "torus"
    elif name.split("-")[0] in (*EARTH, *MORE_EARTH):
        data, space = earth(name.split("-")[0]), "sphere"
    else:
        drawn = load(name)
        data, space = drawn.data, drawn.space
    return Part(space, *splits(data, split + 1, grouped=name in APART)[split], truth)


def space_of(part: Part) -> Space:
    """The space, as the library has it."""
    return make_space(
        part.space, **({"axes": part.train.shape[1]} if part.space == "torus" else {})
    )


def unit_shift(part: Part, space: Space) -> float:
    """What to add to the library's log densities: those of rotations are above the uniform one."""
    return math.log(space.volume) if part.space == "rotation-space" else 0.0


def of_library(part: Part, density: Any) -> Log:
    """The log density of a density of the library, in the unit of the tables."""
    space = space_of(part)
    shift = unit_shift(part, space)

    @torch.no_grad()
    def log_density(points: Data) -> Data:
        at = space.to_chart(points)
        return density.log_prob(at, measure="natural").double().numpy() + shift

    return log_density


def default(part: Part, seed: int, repeats: str) -> tuple[Log, str, Mixture]:
    """What `density fit` chooses."""
    every = np.concatenate([part.train, part.held])
    density = DensityEstimator(space_of(part), seed=seed, repeats=repeats).fit(every).density_
    assert isinstance(density, Mixture)
    return of_library(part, density), "", density


def with_uniform(density: AdaptiveKernels) -> Mixture:
    """A density, and a hundredth even: or one lone point would cost any number of nats."""
    return Mixture([density, UniformDensity(density.space)], [0.99, 0.01])


def best_of(part: Part, tried: dict[str, AdaptiveKernels]) -> tuple[Log, str]:
    """Of some densities the one that is best on the held-out rows."""
    space = space_of(part)
    held = space.to_chart(part.held)
    with torch.no_grad():
        scores = {
            name: float(with_uniform(one).log_prob(held).mean()) for name, one in tried.items()
        }
    name = max(scores, key=scores.__getitem__)
    return of_library(part, with_uniform(tried[name])), name


def one_width(part: Part) -> tuple[Log, str]:
    """Kernels of the best width about all training rows."""
    if part.space != "rotation-space":
        kernels = KernelDensity.tuned(part.train, part.held, round_=part.space == "sphere")
        return kernels.score_samples, f"width {kernels.kappa**-0.5:.2g}, {kernels.floor:g} even"
    space = space_of(part)
    found = kernel_estimates(space, Rows(space.to_chart(part.train)))
    return best_of(part, {name: one for name, one in found.items() if name.startswith("width")})


def one_mixture(part: Part, seed: int) -> tuple[Log, str]:
    """A mixture of the best size."""
    space = space_of(part)
    rows = Rows(space.to_chart(part.train))
    tried = {
        f"{count} components": fit_mixture(
            space, rows, count, generator=torch.Generator().manual_seed(seed)
        )
        for count in MIXTURE_SIZES
        if 4 * count <= len(part.train)
    }
    return best_of(part, tried)


def embedded(part: Part, data: Data) -> Data:
    """Cosines and sines of angles, unit vectors, or quaternions."""
    if part.space == "torus":
        return np.stack([np.cos(data), np.sin(data)], axis=2).reshape(len(data), -1)
    return to_vectors(data) if part.space == "sphere" else data


def fit(job: Job, part: Part) -> tuple[Log, str, Mixture | None]:
    """A log density in the unit of the tables, what was chosen, and the density of the default."""
    seed = job.split
    if job.method == "orbiflow":
        return default(part, seed, "rounding" if job.set in APART else "places")
    if job.method in ("kernels", "mixture"):
        return *(one_width(part) if job.method == "kernels" else one_mixture(part, seed)), None
    if job.method == "sklearn":
        vectors = [embedded(part, own) for own in (part.train, part.held)]
        log, chosen = rivals.scikit_learn(*vectors, signed=part.space != "rotation-space")
        return lambda points: log(embedded(part, points)), chosen, None
    box = rivals.box_of(part.space, part.train.shape[1])
    train, held = box.lay(part.train), box.lay(part.held)
    if job.method == "bvvmmm":
        log, chosen = rivals.sine_mixture(box, train, held, seed)
    else:
        size = rivals.SIZES[job.size]
        log, chosen = FLOWS[job.method](box, train, held, size, seed, job.device), str(size)
    return lambda points: log(box.lay(points)) + box.shift, chosen, None


@cache
def draws(name: str, split: int) -> tuple[Data, Data, Data]:
    """Points to integrate at, in the units of the space, the log density q they are of, and its parts.

    The parts (N, P) are relative to q, so that each has the mean 1.
    """
    part = part_of(name, split)
    space = space_of(part)
    centers = space.to_chart(part.train[:CENTERS])
    even = torch.full((len(centers),), 1 / len(centers), dtype=torch.float64)
    (near,) = spreads(space, centers, [16])
    parts = [
        UniformDensity(space),
        AdaptiveKernels(space, centers, (0.5 / near).clamp(1, 1e7), even),
        *(even_kernels(space, centers, kappa, even) for kappa in DRAWN_KAPPAS),
    ]
    weights = np.array([0.1, 0.4, *[0.1] * len(DRAWN_KAPPAS)])
    proposal = Mixture(parts, weights.tolist())
    points = space.from_chart(proposal.sample(DRAWS, torch.Generator().manual_seed(7)))
    logs = np.stack([of_library(part, own)(points) for own in parts], axis=1)
    log = np.log(np.exp(logs - logs.max(axis=1, keepdims=True)) @ weights) + logs.max(axis=1)
    return points, log, np.exp(logs - log[:, None])


def mass(log_density: Log, job: Job) -> tuple[float, float]:
    """The integral, and its standard error: of what the parts of q, whose integrals are 1, leave."""
    points, log, parts = draws(job.set, job.split)
    ratio = np.exp(log_density(points) - log)
    slopes = np.linalg.lstsq(parts - parts.mean(axis=0), ratio - ratio.mean(), rcond=1e-10)[0]
    rest = ratio - (parts - 1) @ slopes
    return float(rest.mean()), float(rest.std() / len(rest) ** 0.5)


def run(job: Job) -> dict[str, Any]:
    """One fit, as a line of the results."""
    torch.set_num_threads(1)
    found: dict[str, Any] = {**job._asdict()}
    try:
        part = part_of(job.set, job.split)
        begin = time.perf_counter()
        log_density, chosen, density = fit(job, part)
        found |= {"seconds": time.perf_counter() - begin, "chosen": chosen}
        found |= {
            "rows": len(part.train) + len(part.held) + len(part.test),
            "dim": space_of(part).dim,
            "held": -float(np.mean(log_density(part.held))),
            "test": -float(np.mean(log_density(part.test))),
        }
        if part.truth is not None:
            found["truth"] = -float(np.mean(part.truth(part.test)))
        found["mass"], found["mass_error"] = mass(log_density, job)
        if density is not None and part.space != "rotation-space":
            with suppress(KeyError):  # networks and flows of more than two angles
                found["mass"], found["mass_error"] = integral(density)
    except Exception as error:  # one rival that fails must not end the others
        found["error"] = f"{type(error).__name__}: {error}"[:300]
    return found


def jobs_of(given: argparse.Namespace) -> list[Job]:
    """All fits: the default's, then those that take longest."""
    jobs = []
    for method in given.methods.split(","):
        flow = method in FLOWS
        for name in given.sets.split(","):
            if method == "bvvmmm" and name not in TORI:
                continue
            for split in range(given.splits):
                for size in given.sizes if flow else [0]:
                    on = given.device if size and method != "flowjax" else "cpu"
                    jobs.append(Job(name, split, method, size, on))
    slow = {name: at for at, name in enumerate(("rna", "general", "side7", "fire"))}
    return sorted(jobs, key=lambda job: (job.method != OWN[0], -job.size, slow.get(job.set, 9)))


def on_one_core(cores: Any) -> None:
    """Keep a worker to a core of its own, so that no library takes the others'."""
    core = cores.get()
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {core})


def work(given: argparse.Namespace) -> None:
    """Do the fits that `out` lacks, and write each as it ends."""
    out = Path(given.out)
    done = {identity(one) for one in lines(out) if "error" not in one}
    jobs = [job for job in jobs_of(given) if identity(job._asdict()) not in done]
    print(f"{len(jobs)} fits, {len(done)} are there", flush=True)
    context = multiprocessing.get_context("spawn")
    cores = context.Queue()
    for core in sorted(os.sched_getaffinity(0)) * 2:
        cores.put(core)
    arguments = {"mp_context": context, "initializer": on_one_core, "initargs": (cores,)}
    own = [job for job in jobs if job.device == "cpu"]
    lent = [job for job in jobs if job.device != "cpu"]
    begin = time.perf_counter()
    with (
        ProcessPoolExecutor(given.workers, **arguments) as pool,
        ProcessPoolExecutor(given.device_workers, **arguments) as device_pool,
        out.open("a") as file,
    ):
        futures: list[Future[dict[str, Any]]] = [pool.submit(run, job) for job in own]
        futures += [device_pool.submit(run, job) for job in lent]
        for number, future in enumerate(as_completed(futures), 1):
            one = future.result()
            file.write(json.dumps(one) + "\n")
            file.flush()
            said = one.get("error") or (
                f"{one['test']:9.4f} nats, {one['seconds']:6.1f} s, integral "
                f"{one['mass']:.4f} +- {one['mass_error']:.4f}, {one['chosen']}"
            )
            name = f"{one['set']} {one['split']} {one['method']} {one['size']}"
            clock = time.perf_counter() - begin
            print(f"{clock:5.0f} s {number:4}/{len(jobs)} {name:24} {said}", flush=True)


def identity(one: dict[str, Any]) -> tuple[Any, ...]:
    """What tells a fit from others."""
    return one["set"], one["split"], one["method"], one["size"]


def lines(path: Path) -> list[dict[str, Any]]:
    """The fits of a file, the last of each."""
    if not path.exists():
        return []
    every = [json.loads(line) for line in path.read_text().splitlines() if line.strip()]
    return list({identity(one): one for one in every}.values())


TITLES = {
    "quakes": "earthquakes", "fire": "wildfires", "volerup": "volcanic eruptions", "flood": "floods",
    "general": "backbone, general", "prepro": "pre-proline", "rna": "RNA",
    "side3": "backbone and first chi", **dict.fromkeys(SIDES[1:], "side chains"),
    **{name: f"rotations, mixture of {name[4:]}" for name in ROTATIONS},
}  # fmt: skip
"""What sets are called in tables, where it is not their own name."""


def show(found: list[dict[str, Any]]) -> None:
    """Print a table of log densities, and one of seconds and integrals over all sets."""
    good = [one for one in found if "error" not in one]
    print("\nmean negative log density of test rows, nats\n")
    print(f"| set | rows | angles | truth | {' | '.join(METHODS)} |")
    print("|---" * (4 + len(METHODS)) + "|")
    for name in SETS:
        own = [one for one in good if one["set"] == name]
        if own:
            truths = [one["truth"] for one in own if one.get("truth") and one["split"] == 0]
            truth = f"{truths[0]:.3f}" if truths else ""
            cells = [_nats([one for one in own if one["method"] == method]) for method in METHODS]
            title = TITLES.get(name.removesuffix("-apart"), name)
            title += ", places apart" * (name in APART)
            size = own[0]["dim"] if own[0]["set"] in (*TORI, *SIDES, "rna") else "sphere"
            size = "SO(3)" if name in ROTATIONS else size
            print(f"| {title} | {own[0]['rows']:,} | {size} | {truth} | {' | '.join(cells)} |")
    print(f"\n| | {' | '.join(METHODS)} |")
    print("|---" * (1 + len(METHODS)) + "|")
    for title, cell in (("seconds, median of all sets", _seconds), ("integral", _whole)):
        cells = [cell([one for one in good if one["method"] == method]) for method in METHODS]
        print(f"| {title} | {' | '.join(cells)} |")
    for one in found:
        if "error" in one:
            print(f"failed: {' '.join(map(str, identity(one)))}: {one['error']}")


def _chosen(fits: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Of each set and split the size that is better on the held-out rows."""
    parts: dict[tuple[str, int], dict[str, Any]] = {}
    for one in sorted(fits, key=lambda one: -one["held"]):
        parts[one["set"], one["split"]] = one
    return list(parts.values())


def _nats(fits: list[dict[str, Any]]) -> str:
    values = [one["test"] for one in _chosen(fits)]
    spread = f" ± {np.std(values):.3f}" if len(values) > 1 else ""
    return f"{np.mean(values):.3f}{spread}" if values else ""


def _seconds(fits: list[dict[str, Any]]) -> str:
    own: dict[tuple[str, int], float] = {}
    for one in fits:  # of both sizes
        part = one["set"], one["split"]
        own[part] = own.get(part, 0.0) + one["seconds"]
    return f"{np.median(list(own.values())):.0f}" if own else ""


def _whole(fits: list[dict[str, Any]]) -> str:
    if not fits:
        return ""
    worst = max(_chosen(fits), key=lambda one: abs(one["mass"] - 1))
    return f"{worst['mass']:.4f} ± {worst['mass_error']:.4f} ({worst['set']})"


def main() -> None:
    form = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=form)
    parser.add_argument("--sets", default=",".join(SETS))
    parser.add_argument("--methods", default=",".join(OWN[:2]), help=f"all, or of {METHODS}")
    parser.add_argument("--splits", type=int, default=2)
    parser.add_argument("--sizes", type=int, nargs="+", default=list(range(len(rivals.SIZES))))
    parser.add_argument("--workers", type=int, default=2, help="processes with a core each")
    parser.add_argument("--device", default="cpu", help="of flows of the larger size")
    parser.add_argument("--device-workers", type=int, default=4, help="processes that share it")
    parser.add_argument("--out", default="nll.jsonl", help="file of results, which is added to")
    parser.add_argument("--quick", action="store_true", help="one split of side4, with no file")
    parser.add_argument("--show", metavar="FILE", help="print the tables of a file of results")
    given = parser.parse_args()
    if given.methods == "all":
        given.methods = ",".join(METHODS)
    if given.quick:
        given.sets, given.splits, given.out = "side4", 1, tempfile.mkstemp(".jsonl")[1]
    for chosen, known in ((given.sets, SETS), (given.methods, METHODS)):
        if unknown := set(chosen.split(",")) - set(known):
            parser.error(f"unknown: {', '.join(sorted(unknown))}; there are {', '.join(known)}")
    if not given.show:
        work(given)
    show(lines(Path(given.show or given.out)))


if __name__ == "__main__":
    main()
