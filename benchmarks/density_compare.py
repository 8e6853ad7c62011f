"""The default beside a kernel estimate and each part alone: one split, one line of a table."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from density_default_data import Drawn
from density_kde import KernelDensity
from density_unoriented_kde import tuned
from numpy.typing import NDArray

from orbiflow.density import DensityEstimator, to_latlon

Data = NDArray[np.float64]

PARTS: dict[str, dict[str, Any]] = {
    "default": {},
    "flow": {"components": "flow"},
    "kernels": {"components": "kernels"},
    "mixture": {"components": "mixture"},
    "chains": {"components": "chains"},
    "network": {"components": "network"},
}

COLUMNS = ("kernel", "flow", "kernels", "mixture", "chains", "network", "default")

HEAD = (
    f"{'data':14}{'space':11}{'n':>7}"
    + "".join(f"{name:>10}" for name in COLUMNS)
    + f"{'difference':>12}{'to':>8}{'regret':>13}{'seconds':>8}"
)


class Outcome(NamedTuple):
    """Of one split: log densities (N,) of the test rows by each model, and seconds of each fit."""

    scores: dict[str, Data]
    seconds: dict[str, float]


def kernel_estimate(train: Data, space: str) -> Callable[[Data], Data]:
    """Of one width, tuned on a ninth of the rows."""
    held, rest = train[: max(3, len(train) // 9)], train[max(3, len(train) // 9) :]
    if space in ("torus", "sphere"):
        found = KernelDensity.tuned(rest, held, round_=space == "sphere")
        return KernelDensity(
            train, found.kappa, round_=space == "sphere", floor=found.floor
        ).score_samples
    return tuned(rest, held, axes=space == "projective-plane").score_samples


def halves(drawn: Drawn, seed: int, group: NDArray[np.integer] | None = None) -> tuple[Data, Data]:
    """Training and test rows, a tenth; rows of a group (N,) on the same side."""
    rng = np.random.default_rng(seed)
    if group is None:
        order = rng.permutation(len(drawn.data))
    else:
        order = np.argsort(rng.permutation(int(group.max()) + 1)[group], kind="stable")
    cut = len(order) // 10 if drawn.trained is None else len(order) - drawn.trained
    if group is not None:  # no group on both sides
        own = group[order]
        while own[cut] == own[cut - 1]:
            cut += 1
    train = order[cut:]
    if group is not None:
        train = rng.permutation(train)
    return drawn.data[train], drawn.data[order[:cut]]


def compare(
    drawn: Drawn, seed: int, parts: Sequence[str], group: NDArray[np.integer] | None = None
) -> Outcome:
    """Fit the kernel estimate and `parts` (of `PARTS`) to one split."""
    torch.set_num_threads(1)
    train, test = halves(drawn, seed, group)
    scores, seconds = {}, {}
    begin = time.process_time()
    latlon = drawn.space in ("sphere", "projective-plane") and train.shape[1] == 3
    forms = [to_latlon(part) if latlon else part for part in (train, test)]
    scores["kernel"] = kernel_estimate(forms[0], drawn.space)(forms[1])
    seconds["kernel"] = time.process_time() - begin
    for part in parts:
        least = {"chains": 2, "network": 4}.get(part, 0)
        if least and (drawn.space != "torus" or train.shape[1] < least):
            continue
        begin = time.process_time()
        estimator = DensityEstimator(drawn.space, seed=seed, **PARTS[part]).fit(train)
        seconds[part] = time.process_time() - begin
        scores[part] = estimator.score_samples(test)
    if drawn.log_density is not None:
        scores["truth"] = drawn.log_density(test)
    return Outcome(scores, seconds)


def line(name: str, drawn: Drawn, outcomes: list[Outcome]) -> str:
    """A row of the table."""
    scores = {
        key: np.concatenate([outcome.scores[key] for outcome in outcomes])
        for key in outcomes[0].scores
    }
    own = scores["default"]
    others = {key: value for key, value in scores.items() if key not in ("default", "truth")}
    best = max(others, key=lambda key: float(others[key].mean()))
    worse = others[best] - own
    error = float(worse.std() / math.sqrt(len(worse)))
    mean = float(worse.mean())
    columns = "".join(
        f"{-scores[key].mean():10.3f}" if key in scores else f"{'':10}" for key in COLUMNS
    )
    regret = f"{(scores['truth'] - own).mean():8.3f}" if "truth" in scores else " " * 8
    seconds = np.mean([outcome.seconds["default"] for outcome in outcomes])
    verdict = "met" if mean <= max(0.01, 2 * error) else "MISSED"
    return (
        f"{name:14}{drawn.space[:10]:11}{drawn.trained or len(drawn.data):7}{columns}"
        f"{mean:9.3f} +- {error:.3f}  {best:8}{regret}{seconds:8.1f}  {verdict}"
    )
