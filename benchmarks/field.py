"""Cost of one evaluation and one gradient of a symmetric Fourier field, form against form.

    python benchmarks/field.py [--quick] 2>/dev/null    (torch's profiler chats on standard error)

Four forms of the same model class, at N = 5,000 points:

    ours       FourierField: symmetrized once, in coefficient space, then one separable sum
    separable  an unsymmetrized separable sum inside the paper's nested operators
    per mode   the paper's sum over all pairs of frequencies inside its nested operators
    product    the bare matrix product that `ours` contains, as a floor

The gradient is that of sum V^2 with respect to parameters and points; its floor is the three products
forward, weights and points. One torch thread. The forms take turns (A B C D A B C D ...), a ratio is
the median of the ratios of neighbouring runs, so that a busy machine slows all forms alike.

Memory is the peak of tensors allocated during a call beyond those alive before it, counted by torch's
own profiler from every allocation and release.

The per-mode form holds four features a mode and point for each of up to 18 nested terms, gigabytes at
Omega = 30: it is run on 1,000 points at a time, its gradients added up. That costs it no time; in one
piece it would hold five times the memory shown.
"""

from __future__ import annotations

import argparse
import math
import os
import statistics
import time
from collections.abc import Callable
from typing import NamedTuple

os.environ.setdefault("KINETO_LOG_LEVEL", "99")  # the memory profiler chats otherwise

import torch
from torch import Tensor, nn

from orbiflow.fields import FourierField, VectorField, periodic_operator, summed_over_powers
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles import CLASSES, IsohedralClass

POINTS = 5_000
FREQUENCIES = (5, 10, 15, 30)
CLASS_NAMES = ("IH4", "IH21")
DTYPES = (torch.float32, torch.float64)
FORMS = ("ours", "separable", "per mode", "product")
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


class Case(NamedTuple):
    """The forms of one class, frequency and precision: evaluation and gradient of each."""

    evaluate: dict[str, Callable[[], object]]
    gradient: dict[str, Callable[[], object]]


def prepare(row: IsohedralClass, max_frequency: int, dtype: torch.dtype) -> Case:
    """Random fields of every form and the calls to be timed."""
    torch.manual_seed(0)
    group = row.group()
    points = torch.rand(POINTS, 2, dtype=dtype) * 6 - 3
    ours = FourierField(group, max_frequency, dtype=dtype)
    bare = FourierField(CrystallographicGroup.generate(group.lattice), max_frequency, dtype=dtype)
    per_mode = PerModeField(max_frequency, dtype)
    with torch.no_grad():
        ours.parameters_.normal_()
        bare.parameters_.normal_()
    fields: dict[str, tuple[nn.Module, VectorField]] = {
        "ours": (ours, ours),
        "separable": (bare, nested(bare, row)),
        "per mode": (per_mode, nested(periodic_operator(per_mode, group.lattice), row)),
    }
    evaluate: dict[str, Callable[[], object]] = {}
    gradient: dict[str, Callable[[], object]] = {}
    for name, (module, field) in fields.items():
        chunk = CHUNK if name == "per mode" else POINTS
        evaluate[name] = evaluation(field, points, chunk)
        gradient[name] = gradient_of(field, list(module.parameters()), points, chunk)
    evaluate["product"], gradient["product"] = products(ours, dtype)
    return Case(evaluate, gradient)


def evaluation(field: VectorField, points: Tensor, chunk: int) -> Callable[[], object]:
    """One evaluation, nothing tracked."""

    def call() -> list[Tensor]:
        with torch.no_grad():
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


def products(
    ours: FourierField, dtype: torch.dtype
) -> tuple[Callable[[], object], Callable[[], object]]:
    """The matrix products inside `ours`: (C A1 x A2) (A2 x N), and for the gradient three."""
    weights = ours.weights().detach()[0]
    weights = weights.reshape(-1, weights.shape[-1])
    table = torch.rand(weights.shape[1], POINTS, dtype=dtype)
    dual = torch.rand(weights.shape[0], POINTS, dtype=dtype)
    return (lambda: weights @ table, lambda: (weights @ table, dual @ table.T, weights.T @ dual))


class Timing(NamedTuple):
    """Median seconds of each form, and the median of each form's ratio to `ours`."""

    seconds: dict[str, float]
    ratios: dict[str, float]


def seconds(call: Callable[[], object], repeats: int = 1) -> float:
    """Time of one call, averaged over `repeats`."""
    started = time.perf_counter()
    for _ in range(repeats):
        call()
    return (time.perf_counter() - started) / repeats


def measure(calls: dict[str, Callable[[], object]], rounds: int) -> Timing:
    """The quick forms take many turns with each other, the slow one few with `ours`."""
    quick = in_turns({name: calls[name] for name in ("ours", "separable", "product")}, 5 * rounds)
    slow = in_turns({name: calls[name] for name in ("ours", "per mode")}, rounds)
    return Timing({**slow.seconds, **quick.seconds}, {**slow.ratios, **quick.ratios})


def in_turns(calls: dict[str, Callable[[], object]], rounds: int) -> Timing:
    """Medians of times, and of ratios within a turn.

    Where a form takes over a second, a third of the turns.

    A form that takes milliseconds runs several times a turn, or the clock would be all that is seen.
    """
    repeats: dict[str, int] = {}
    slow = False
    for name, call in calls.items():
        cost = seconds(call)  # warms up allocator and caches as well
        if cost < 1.0:
            cost = seconds(call)
        repeats[name] = max(1, min(20, int(0.02 / cost)))
        slow = slow or cost > 1.0
    turns: list[dict[str, float]] = []
    for _ in range(rounds // 3 if slow else rounds):
        turns.append({name: seconds(call, repeats[name]) for name, call in calls.items()})
    return Timing(
        {name: statistics.median(turn[name] for turn in turns) for name in calls},
        {name: statistics.median(turn[name] / turn["ours"] for turn in turns) for name in calls},
    )


def peak_bytes(call: Callable[[], object]) -> int:
    """Peak of tensor memory that one call allocates."""
    with torch.profiler.profile(
        activities=[torch.profiler.ProfilerActivity.CPU], profile_memory=True
    ) as profile:
        call()
    held = peak = 0
    events = profile.profiler.kineto_results.events()  # type: ignore[union-attr]
    for event in sorted(events, key=lambda e: e.start_ns()):
        if event.name() == "[memory]":
            held += event.nbytes()  # pyright: ignore[reportAttributeAccessIssue]
            peak = max(peak, held)
    return peak


def report(quantity: str, rounds: int) -> None:
    """Print the table of one quantity, "evaluate" or "gradient"."""
    print(f"\n{quantity}, N = {POINTS:,}")
    print(
        f"{'class':6}{'dtype':9}{'Omega':>6}"
        + "".join(f"{form + ' ms':>14}" for form in FORMS)
        + f"{'per mode/ours':>15}{'separable/ours':>16}{'ours/product':>14}"
        + "".join(f"{form + ' MB':>14}" for form in FORMS[:3])
    )
    for name in CLASS_NAMES:
        for dtype in DTYPES:
            for max_frequency in FREQUENCIES:
                calls = getattr(prepare(CLASSES[name], max_frequency, dtype), quantity)
                timing = measure(calls, rounds)
                memory = [peak_bytes(calls[form]) / 1e6 for form in FORMS[:3]]
                print(
                    f"{name:6}{str(dtype).removeprefix('torch.'):9}{max_frequency:>6}"
                    + "".join(f"{1e3 * timing.seconds[form]:>14.2f}" for form in FORMS)
                    + f"{timing.ratios['per mode']:>15.1f}{timing.ratios['separable']:>16.1f}"
                    + f"{1 / timing.ratios['product']:>14.2f}"
                    + "".join(f"{size:>14.1f}" for size in memory),
                    flush=True,
                )


def main() -> None:
    """Parse the command line and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--quick", action="store_true", help="3 turns instead of 9")
    rounds = 3 if parser.parse_args().quick else 9
    torch.set_num_threads(1)
    print(f"torch {torch.__version__}, one thread, {rounds} turns, more if quick, fewer if slow")
    for quantity in ("evaluate", "gradient"):
        report(quantity, rounds)


if __name__ == "__main__":
    main()
