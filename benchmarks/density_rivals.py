"""The default beside circular spline flows and a tuned kernel estimate, on the same splits.

    pip install zuko
    python benchmarks/density_rivals.py [--sets general,fire,...] [--splits 3] [--device cuda]

For each set: the mean negative log density of test rows in nats (per radian^d, or steradian), its
spread over the splits, and seconds of a fit. The rival is zuko's NCSF, a neural circular spline flow
(Durkan and others, 2019; Rezende and others, 2020) of three transforms, trained by Adam on eight ninths
of the training rows till the last ninth grows no likelier, then set back to where that was likeliest.
Directions are laid on a cylinder of equal areas, longitude and sine of latitude, so that its densities
are per steradian, too. Its integral is checked on a grid where there are two angles.
"""

from __future__ import annotations

import argparse
import copy
import math
import time
from typing import Any

import numpy as np
import torch
from density_data import EARTH, TORI, Data, sidechains, splits
from density_record import load

from orbiflow.density import DensityEstimator

SETS = (*EARTH, *TORI, "rna", "side4", "side6")
EPOCHS, PATIENCE, BATCH, RATE = 400, 40, 512, 1e-3
HIDDEN, TRANSFORMS = (128, 128), 3


def rows_of(name: str) -> tuple[Data, str]:
    """Rows of a set, and their space."""
    drawn = sidechains(int(name[4:])) if name.startswith("side") else load(name)
    return drawn.data, drawn.space


def on_circles(data: Data, space: str) -> tuple[Data, float]:
    """Rows as angles from -pi to pi, and what to add to log densities of these."""
    if space != "sphere":
        return (data + math.pi) % (2 * math.pi) - math.pi, 0.0
    lat, lon = np.radians(data).T
    return np.stack(
        [(lon + math.pi) % (2 * math.pi) - math.pi, math.pi * np.sin(lat)], 1
    ), math.log(math.pi)


def spline_flow(train: Data, held: Data, seed: int, device: str) -> Any:
    """A neural circular spline flow, trained until `held` grows no likelier."""
    import zuko  # pyright: ignore[reportMissingImports]

    torch.manual_seed(seed)
    flow: Any = zuko.flows.NCSF(train.shape[1], transforms=TRANSFORMS, hidden_features=HIDDEN).to(
        device
    )
    rows, seen = (torch.tensor(own, dtype=torch.float32, device=device) for own in (train, held))
    optimizer = torch.optim.Adam(flow.parameters(), RATE)
    best, kept, waited = math.inf, copy.deepcopy(flow.state_dict()), 0
    for _ in range(EPOCHS):
        for batch in torch.split(torch.randperm(len(rows), device=device), BATCH):
            loss = -flow().log_prob(rows[batch]).mean()
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
        with torch.no_grad():
            now = float(-flow().log_prob(seen).mean())
        if now < best - 1e-4:
            best, kept, waited = now, copy.deepcopy(flow.state_dict()), 0
        elif (waited := waited + 1) >= PATIENCE:
            break
    flow.load_state_dict(kept)
    return flow


def mass(flow: Any, device: str, count: int = 400) -> float:
    """The integral over two angles."""
    line = (torch.arange(count) + 0.5) / count * 2 * math.pi - math.pi
    grid = torch.cartesian_prod(line, line).to(device)
    with torch.no_grad():
        return float(flow().log_prob(grid).double().exp().mean()) * (2 * math.pi) ** 2


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--sets", default=",".join(SETS))
    parser.add_argument("--splits", type=int, default=3)
    parser.add_argument("--device", default="cpu")
    given = parser.parse_args()
    print("set          rows d  orbiflow   spread  seconds |  NCSF     spread  seconds  integral")
    for name in given.sets.split(","):
        data, space = rows_of(name)
        ours, theirs, times, masses = list[float](), list[float](), list[tuple[float, float]](), []
        for seed, (train, held, test) in enumerate(splits(data, given.splits)):
            begin = time.perf_counter()
            fit = DensityEstimator(space, seed=seed).fit(np.concatenate([train, held]))
            first = time.perf_counter() - begin
            ours.append(-fit.score(test))
            (a, shift), (b, _), (c, _) = (on_circles(own, space) for own in (train, held, test))
            begin = time.perf_counter()
            flow = spline_flow(a, b, seed, given.device)
            times.append((first, time.perf_counter() - begin))
            with torch.no_grad():
                at = torch.tensor(c, dtype=torch.float32, device=given.device)
                theirs.append(-float(flow().log_prob(at).double().mean()) - shift)
            masses += [mass(flow, given.device)] if c.shape[1] == 2 else []
        seconds = np.mean(times, axis=0)
        whole = f"{np.mean(masses):9.4f}" if masses else "        -"
        left = f"{np.mean(ours):9.4f} {np.std(ours):8.4f} {seconds[0]:8.1f}"
        right = f"{np.mean(theirs):9.4f} {np.std(theirs):8.4f} {seconds[1]:8.1f} {whole}"
        print(f"{name:10} {len(data):6} {data.shape[1]} {left} | {right}", flush=True)


if __name__ == "__main__":
    main()
