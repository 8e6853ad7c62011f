"""A benchmark of densities on unoriented surfaces: the Klein bottle and the projective plane.

    python benchmarks/density_unoriented.py [--splits K] [--seconds S] [--quick] [DATA ...]

Defined in docs/benchmark-unoriented.md. Mean negative log-likelihood of the test points in nats, per
radian^2 of theta, phi on the Klein bottle (area 2 pi^2) or per steradian on the projective plane (area
2 pi), over random 80/10/10 splits: of a flow alone, beside the uniform density, a kernel density summed
over the identification and tuned on the validation points, and, for the two synthetic sets, the true
density. The integral is the flow's.
"""

from __future__ import annotations

import argparse
import math
import time
from typing import NamedTuple

import numpy as np
import torch
from density_data import Data, splits
from density_kde import Kernel, UnorientedKernelDensity, tuned
from density_known import AXES, KLEIN, known, unoriented

from orbiflow.density import Density, DensityEstimator

QUERIES, KERNEL_QUERIES = 100_000, 5_000
"""Points that evaluation is timed on; kernels are so slow that fewer are taken, and scaled up."""


class Outcome(NamedTuple):
    """Of one split: test NLLs, fit seconds, the flow's integral, and what the kernel came to."""

    flow: float
    kde: float
    truth: float
    flow_fit: float
    kde_fit: float
    mass: float
    kernel: Kernel
    queries: tuple[float, float]


def run(name: str, data: Data, seed: int, seconds: float, detail: int) -> Outcome:
    """One split; queries are timed on the first alone."""
    axes = name in AXES
    train, held, test = splits(data, seed + 1)[seed]
    begin = time.perf_counter()
    kde = tuned(train, held, axes=axes)
    kde_fit = time.perf_counter() - begin
    begin = time.perf_counter()
    estimator = DensityEstimator(
        "projective-plane" if axes else "klein-bottle",
        components=("flow",),
        max_frequency=detail,
        validation=len(held) / (len(train) + len(held)),
        seconds=seconds,
        seed=seed,
    ).fit(np.concatenate([train, held]))
    flow_fit = time.perf_counter() - begin
    truth = known(name)
    flow = estimator.density_
    return Outcome(
        -estimator.score(test),
        -float(kde.score_samples(test).mean()),
        math.nan if truth is None else -float(truth.log_density(test).mean()),
        flow_fit,
        kde_fit,
        flow.mass(),
        kde.kernel,
        timed(axes, flow, kde) if seed == 0 else (math.nan, math.nan),
    )


def timed(axes: bool, flow: Density, kde: UnorientedKernelDensity) -> tuple[float, float]:
    """Seconds for `QUERIES` points, uniform on the surface, of the flow and of the kernel density."""
    rng = np.random.default_rng(0)
    queries = rng.uniform(0, 2 * np.pi, (QUERIES, 2))
    if axes:
        queries = np.degrees(
            np.stack([np.arcsin(rng.uniform(-1, 1, QUERIES)), queries[:, 1] - np.pi], axis=1)
        )
    begin = time.perf_counter()
    with torch.no_grad():
        flow.log_prob(flow.space.to_chart(queries), measure="natural")
    middle = time.perf_counter()
    kde.score_samples(queries[:KERNEL_QUERIES])
    scale = QUERIES / KERNEL_QUERIES
    return middle - begin, scale * (time.perf_counter() - middle)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", nargs="*", choices=(*KLEIN, *AXES, []))
    parser.add_argument("--splits", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=20.0, help="of refinement")
    parser.add_argument("--max-frequency", type=int, default=8)
    parser.add_argument("--quick", action="store_true", help="three-axes, one split, 5 s")
    options = parser.parse_args()
    names = options.data or [*KLEIN, *AXES]
    count, seconds = options.splits, options.seconds
    if options.quick:
        names, count, seconds = ["three-axes"], 1, 5.0
    torch.set_num_threads(1)
    print(
        f"{count} splits, {seconds:g} s of refinement, detail {options.max_frequency}, one thread"
    )
    print(
        "data              N  uniform      kde               flow          flow - kde"
        "     true  kde fit  flow fit   100k: kde s  flow s     mass"
    )
    for name in names:
        data = unoriented(name)
        rows = [run(name, data, seed, seconds, options.max_frequency) for seed in range(count)]
        print_row(name, len(data), rows)
        truth = known(name)
        if truth is not None:
            print(f"  entropy {truth.entropy:.4f}")
        for row in rows:
            widths = ", ".join(f"{k:.0f}" for k in row.kernel.concentrations)
            print(
                f"  kde {row.kde:.4f} (concentration {widths}; uniform share {row.kernel.share:g}), "
                f"flow {row.flow:.4f}, true {row.truth:.4f}",
                flush=True,
            )


def print_row(name: str, size: int, rows: list[Outcome]) -> None:
    """Means and standard deviations over the splits; the worst integral."""
    area = 2 * math.pi if name in AXES else 2 * math.pi**2
    flow, kde, truth, flow_fit, kde_fit, mass = np.array([row[:6] for row in rows]).T
    worst = mass[abs(mass - 1).argmax()]
    scores = (f"{v.mean():9.4f} +- {v.std():.4f}" for v in (kde, flow, flow - kde))
    print(
        f"{name:14}{size:6}{math.log(area):9.4f}{''.join(scores)}"
        f"{truth.mean():9.4f}{kde_fit.mean():9.1f}{flow_fit.mean():10.1f}"
        f"{rows[0].queries[1]:14.2f}{rows[0].queries[0]:8.2f}{worst:9.5f}",
        flush=True,
    )


if __name__ == "__main__":
    main()
