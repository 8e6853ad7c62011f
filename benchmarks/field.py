"""Cost of one evaluation and one gradient of a symmetric Fourier field, form against form.

    python benchmarks/field.py [--quick]

Two forms of the same model class, at N = 5,000 points:

    ours       FourierField: symmetrized once, in coefficient space, then one separable sum
    per mode   the paper's sum over all pairs of frequencies inside its nested operators

The gradient is that of sum V^2 with respect to parameters and points. One torch thread. The forms take
turns; a ratio is the median of those of neighbouring runs, so that a busy machine slows both alike.

The per-mode form holds four features a mode and point for each of up to 18 nested terms, gigabytes at
Omega = 30: it is run on 1,000 points at a time, its gradients added up, which costs it no time.
"""

from __future__ import annotations

import argparse
import math
import statistics
import time
from collections.abc import Callable

import torch
from torch import Tensor, nn

from orbiflow.fields import FourierField, VectorField, periodic_operator, summed_over_powers
from orbiflow.tiles import CLASSES, IsohedralClass

POINTS = 5_000
FREQUENCIES = (5, 10, 15, 30)
CLASS_NAMES = ("IH4", "IH21")
DTYPES = (torch.float32, torch.float64)
CHUNK = 1_000
"""Points at a time in the per-mode form."""


class PerModeField(nn.Module):
    """The paper's F on the unit square (eq. Fourier): each pair of frequencies by itself."""

    i: Tensor
    j: Tensor

    def __init__(self, max_frequency: int, dtype: torch.dtype) -> None:
        super().__init__()
        count = torch.arange(max_frequency + 1, dtype=dtype)
        i, j = torch.meshgrid(count, count, indexing="ij")
        self.register_buffer("i", 2 * math.pi * i.reshape(-1))
        self.register_buffer("j", 2 * math.pi * j.reshape(-1))
        self.theta = nn.Parameter(0.01 * torch.randn(2, 4, i.numel(), dtype=dtype))

    def forward(self, points: Tensor) -> Tensor:
        """F at points (N, 2)."""
        x, y = points[:, :1] * self.i, points[:, 1:] * self.j
        features = torch.stack(
            [x.cos() * y.cos(), x.cos() * y.sin(), x.sin() * y.cos(), x.sin() * y.sin()]
        )
        return torch.einsum("lnm,klm->nk", features, self.theta)


def nested(field: VectorField, row: IsohedralClass) -> VectorField:
    """The paper's operators around `field`, innermost last."""
    for isometry, terms in reversed(row.paper_operators()):
        field = summed_over_powers(field, isometry, terms)
    return field


def calls(
    row: IsohedralClass, max_frequency: int, dtype: torch.dtype, *, gradient: bool
) -> tuple[Callable[[], object], Callable[[], object]]:
    """One evaluation or gradient of a random field of both forms, to be timed."""
    torch.manual_seed(0)
    group = row.group()
    points = torch.rand(POINTS, 2, dtype=dtype) * 6 - 3
    ours = FourierField(group, max_frequency, dtype=dtype)
    per_mode = PerModeField(max_frequency, dtype)
    with torch.no_grad():
        ours.parameters_.normal_()
    paper = nested(periodic_operator(per_mode, group.lattice), row)
    call = gradient_of if gradient else evaluation
    return (
        call(ours, list(ours.parameters()), points, POINTS),
        call(paper, list(per_mode.parameters()), points, CHUNK),
    )


def evaluation(
    field: VectorField, _parameters: list[nn.Parameter], points: Tensor, chunk: int
) -> Callable[[], object]:
    """One evaluation, nothing tracked."""

    @torch.no_grad()
    def call() -> list[Tensor]:
        return [field(part) for part in points.split(chunk)]

    return call


def gradient_of(
    field: VectorField, parameters: list[nn.Parameter], points: Tensor, chunk: int
) -> Callable[[], object]:
    """One gradient of sum V^2 with respect to parameters and points."""
    parts = [part.clone().requires_grad_() for part in points.split(chunk)]

    def call() -> None:
        for leaf in (*parameters, *parts):
            leaf.grad = None
        for part in parts:
            field(part).square().sum().backward()

    return call


def seconds(call: Callable[[], object], repeats: int = 1) -> float:
    """Time of one call, averaged over `repeats`."""
    started = time.perf_counter()
    for _ in range(repeats):
        call()
    return (time.perf_counter() - started) / repeats


def in_turns(ours: Callable[[], object], other: Callable[[], object], rounds: int) -> list[float]:
    """Median seconds of both forms, and the median of their ratios within a turn.

    Ours takes milliseconds and runs several times a turn, or the clock would be all that is seen. Where
    the other takes over a second, there are a third of the turns.
    """
    ours()  # warms up allocator and caches
    if seconds(other) > 1.0:
        rounds = max(1, rounds // 3)
    repeats = max(1, min(20, int(0.02 / seconds(ours))))
    turns = [(seconds(ours, repeats), seconds(other)) for _ in range(rounds)]
    table = [(own, theirs, theirs / own) for own, theirs in turns]
    return [statistics.median(column) for column in zip(*table, strict=True)]


def report(quantity: str, rounds: int, frequencies: tuple[int, ...]) -> None:
    """Print the table of one quantity, "evaluate" or "gradient"."""
    print(f"\n{quantity}, N = {POINTS:,}")
    print(f"{'class':6}{'dtype':9}{'Omega':>6}{'ours ms':>14}{'per mode ms':>14}{'ratio':>10}")
    for name in CLASS_NAMES:
        for dtype in DTYPES:
            for max_frequency in frequencies:
                both = calls(CLASSES[name], max_frequency, dtype, gradient=quantity == "gradient")
                own, theirs, ratio = in_turns(*both, rounds)
                print(
                    f"{name:6}{str(dtype).removeprefix('torch.'):9}{max_frequency:>6}"
                    f"{1e3 * own:>14.2f}{1e3 * theirs:>14.2f}{ratio:>10.1f}",
                    flush=True,
                )


def main() -> None:
    """Parse the command line and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="3 turns, low frequencies")
    quick = parser.parse_args().quick
    rounds, frequencies = (3, FREQUENCIES[:2]) if quick else (9, FREQUENCIES)
    torch.set_num_threads(1)
    print(f"torch {torch.__version__}, one thread, {rounds} turns, fewer if slow")
    for quantity in ("evaluate", "gradient"):
        report(quantity, rounds, frequencies)


if __name__ == "__main__":
    main()
