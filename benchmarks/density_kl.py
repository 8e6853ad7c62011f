"""KL divergence of fitted densities from the paper's three targets, on the four spaces.

    python benchmarks/density_kl.py [--flow] [--points N] [--seeds K] [--quick]
        [SPACE ...]

What `density fit` chooses by itself; --flow: a flow alone, with settings for each target.

Targets on the unit square (the paper's): four and six Gaussians of variance 0.005, and the 5 x 5
checkerboard. On sphere and projective plane also with the round area in place of the square's: the
target is then the same function times the area factor. KL by quadrature on 200 x 200 points at
doubled steps; mass as `Density.mass` has it. Bars: 0.01, 0.02, 0.08, each within 60 s on 2
cores (a fit uses one), mass 1 within 1e-3.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import torch
from common import ROOT

from orbiflow.density import (
    SPACES,
    Density,
    DensitySettings,
    FlowDensity,
    FlowSettings,
    fit_automatic,
    fit_density,
    make_space,
)
from orbiflow.density.models import kl_by_quadrature, midpoints

sys.path.append(str(ROOT))  # which has the paper's targets
from reproduction.densities import FIT_SETTINGS, KL, TargetMeasure, drawn, weighted

BARS = {"4-gaussian": 0.01, "6-gaussian": 0.02, "checkerboard": 0.08}
AUTHORS = {
    "torus": {"4-gaussian": 0.099, "6-gaussian": 0.058, "checkerboard": 0.293},
    "sphere": {"4-gaussian": 0.034, "6-gaussian": 0.023, "checkerboard": 0.205},
}


def run(
    job: tuple[str, str, TargetMeasure, int, int, bool],
) -> tuple[float, float, float, float, int]:
    """KL, mass, seconds, validation NLL and steps of one fit."""
    torch.set_num_threads(1)
    name, label, measure, count, seed, flow = job
    space = make_space(name)
    points = drawn(label, space, measure, count, seed)
    begin = time.perf_counter()
    if flow:
        settings = FlowSettings(seed=seed, **FIT_SETTINGS[label])  # type: ignore[arg-type]
        found, report = fit_density(space, points, settings)
        density = finer(found)
    else:
        density, report = fit_automatic(space, points, DensitySettings(seed=seed))
    spent = time.perf_counter() - begin
    grid = midpoints(space, 200)
    with torch.no_grad():
        values = density.log_prob(grid)
    kl = kl_by_quadrature(weighted(label, space, grid, measure), values)
    return kl, report.mass or math.nan, spent, report.validation_nll, report.steps


def finer(density: Density) -> Density:
    """A flow's density with twice as many steps."""
    if not isinstance(density, FlowDensity):
        return density
    return density.with_steps(2 * density.flow.steps)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("spaces", nargs="*", metavar="SPACE", help=f"{', '.join(SPACES)} (all)")
    parser.add_argument("--points", type=int, default=131072)
    parser.add_argument("--flow", action="store_true", help="a flow alone")
    parser.add_argument("--seeds", type=int, default=1, help="the worst is reported")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--quick", action="store_true", help="the torus, few points")
    options = parser.parse_args()
    if unknown := set(options.spaces) - set(SPACES):
        parser.error(f"no such space: {', '.join(sorted(unknown))}")
    spaces = options.spaces or list(SPACES)
    count = options.points
    if options.quick:
        spaces, count = ["torus"], 4096
    rows = [
        (space, label, measure)
        for space in spaces
        for measure in (("flat", "round") if space in ("sphere", "projective-plane") else ("flat",))
        for label in BARS
    ]
    jobs = [(*row, count, seed, options.flow) for row in rows for seed in range(options.seeds)]
    print(
        f"{count} points, {options.seeds} seeds, the worst of them; {options.workers} fits at once"
    )
    print("space            target       measure     KL    bar  paper authors     mass  seconds")
    with ProcessPoolExecutor(options.workers) as pool:
        found = pool.map(run, jobs)
        for space, label, measure in rows:
            outcomes = [next(found) for _ in range(options.seeds)]
            kl = max(o[0] for o in outcomes)
            mass = max((o[1] for o in outcomes), key=lambda m: abs(m - 1))
            spent = max(o[2] for o in outcomes)
            paper, authors = (
                f"{table.get(space, {}).get(label, math.nan):7.3f}" for table in (KL, AUTHORS)
            )
            met = "met" if kl <= BARS[label] and spent <= 60 and abs(mass - 1) < 1e-3 else ""
            print(
                f"{space:17}{label:13}{measure:6}{kl:9.4f}{BARS[label]:7.2f}{paper}{authors}"
                f"{mass:10.5f}{spent:8.1f}  {met}",
                flush=True,
            )


if __name__ == "__main__":
    main()
