"""Fitting a density on a torus of many angles: mixture base, flow matching, likelihood."""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from orbiflow.density.arguments import (
    check_kind,
    check_ranges,
    check_share,
    silent,
)
from orbiflow.density.fitting.budget import Budget, training
from orbiflow.density.fitting.chains import ChainsFit, fit_chains
from orbiflow.density.fitting.flow_matching import coupled
from orbiflow.density.fitting.likelihood import Refinement
from orbiflow.density.fitting.report import (
    MOST_REPORTED,
    FitReport,
    Progress,
    mean_nll,
    own_points,
    repeats_note,
    settle,
    split,
    steps_note,
)
from orbiflow.density.models import (
    Base,
    NeuralFlow,
    SymmetricDensity,
    UniformBase,
)
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.fields import (
    MAX_DEPTH,
    MAX_WAVES,
    MAX_WIDTH,
    NeuralTorusField,
)
from orbiflow.typed_torch import adam

MOST_STEPS = 128
"""Runge-Kutta steps to which they are doubled where the integrator has not converged."""

HELD = 2048
"""Validation points that training looks at."""

LOOKS = 10
"""At the validation points, evenly spread over each phase."""

PATIENCE = 3
"""Looks that may bring nothing better."""

WORTHWHILE = 0.01
"""Nats of validation that a flow must gain over its mixture, to be worth its integration."""

CLIP = 10.0
"""Largest norm of a gradient."""

WARM = 50
"""Iterations over which the learning rate grows to its full size."""


@dataclass(frozen=True)
class NeuralSettings:
    """Knobs of `fit_neural`; the defaults are measured on RNA torsions (benchmarks/density_rna.py).

    - `base`: "mixture" (of von Mises chains, see `fit_chains`) or "uniform".
    - `components`, `members`: of the mixture, at most.
    - `width`, `depth`, `waves`: of the network, see `NeuralTorusField`.
    - `steps`: Runge-Kutta steps; doubled where the integrator has not converged. None for 2 with a
      mixture, 8 without.
    - `matching`: iterations of flow matching; None for 0 with a mixture, 20,000 without.
    - `refinement`: iterations of descent on the negative log-likelihood.
    - `batch`: points an iteration.
    - `paired`: optimal transport within batches, for flow matching.
    - `matching_rate`, `refinement_rate`: of Adam, at their largest.
    - `validation`: share of the points held out to choose among iterates and mixtures.
    - `seconds`: of training at most, half of it for the mixture, looked at between iterations. A fit
      that it ends depends on the machine's speed, and its report says so.
    - `seed`: of the split, the starts, the network and the batches.
    """

    base: str = "mixture"
    components: int = 64
    members: int = 12
    width: int = 128
    depth: int = 3
    waves: int = 2
    steps: int | None = None
    matching: int | None = None
    refinement: int = 400
    batch: int = 256
    paired: bool = False
    matching_rate: float = 2e-3
    refinement_rate: float = 1e-3
    validation: float = 0.1
    seconds: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        whole = [
            ("components", 1, 4096),
            ("members", 1, 64),
            ("width", 1, MAX_WIDTH),
            ("depth", 1, MAX_DEPTH),
            ("waves", 1, MAX_WAVES),
            ("refinement", 0, 1_000_000),
            ("batch", 1, 65536),
            ("seed", -(2**63), 2**64 - 1),
        ]
        chosen = (("steps", 1, MOST_STEPS), ("matching", 0, 10_000_000))
        whole += [row for row in chosen if getattr(self, row[0]) is not None]
        real = (("matching_rate", 0, 1), ("refinement_rate", 0, 1), ("seconds", 0, math.inf))
        check_ranges(self, whole, integer=True)
        check_ranges(self, real)
        check_share(self.validation)
        if self.base not in ("mixture", "uniform"):
            raise OrbiflowError(f'base must be "mixture" or "uniform", got {self.base!r}')

    @property
    def first_steps(self) -> int:
        """Runge-Kutta steps to begin with."""
        return self.steps or (2 if self.base == "mixture" else 8)

    @property
    def matchings(self) -> int:
        """Iterations of flow matching."""
        if self.matching is not None:
            return self.matching
        return 0 if self.base == "mixture" else 20_000


@training()
def fit_neural(
    space: Space,
    points: Tensor,
    settings: NeuralSettings | None = None,
    *,
    progress: Progress | None = None,
) -> tuple[SymmetricDensity, FitReport]:
    """Fit a neural flow on a mixture or uniform base to canonical points of a torus.

    The base by expectation-maximization; the flow by flow matching (Lipman et al., 2023) along the
    geodesics of the torus, then by Adam on the exact log-likelihood. The iterate that is best on
    the validation points, at doubled steps, is kept: the flow is never worse there than its base.

    Args:
        space: a `Torus`.
        points: (N, d) in the chart, N >= 10 different ones.
        settings: default `NeuralSettings()`.
        progress: told how far it is.

    Returns:
        The density, float64, and the report.

    Raises:
        OrbiflowError: for a space that is not a torus, or too few points.
    """
    settings = NeuralSettings() if settings is None else settings
    check_kind(settings, NeuralSettings, "settings")
    if not check_kind(space, Space, "space", "see `make_space`").is_torus:
        raise OrbiflowError(f"neural flows are for tori, not for the {space.name}")
    say = progress or silent
    budget = Budget(seconds=settings.seconds)
    generator = torch.Generator().manual_seed(settings.seed)
    points = own_points(space, points)
    train, validation, duplicates = split(points, settings.validation, generator)
    base, mixture = _base(space, train, validation, settings, say)
    field = NeuralTorusField(
        space.dim,
        width=settings.width,
        depth=settings.depth,
        waves=settings.waves,
        seed=settings.seed,
        dtype=torch.float32,
    )
    density = SymmetricDensity(space, NeuralFlow(field, steps=settings.first_steps), base)
    trainer = _Trainer(density, train, validation[:HELD], settings, generator, say, budget)
    start_nll = trainer.match()
    stages = [trainer.refine()] if settings.refinement else []
    density.flow.double()
    error, mass = settle(density, validation[:HELD], MOST_STEPS)
    notes = [
        *repeats_note(len(points), duplicates),
        *_notes(mixture, trainer),
        *steps_note(density, error),
    ]
    report = FitReport(
        points=len(points),
        duplicates=duplicates,
        train=len(train),
        validation=len(validation),
        start_nll=start_nll,
        train_nll=mean_nll(density, train[:MOST_REPORTED]),
        validation_nll=mean_nll(density, validation[:MOST_REPORTED]),
        stages=tuple(stages),
        steps=density.flow.steps,
        mass=mass,
        integration_error=error,
        notes=tuple(notes),
    )
    return density, report


def _base(
    space: Space, train: Tensor, validation: Tensor, settings: NeuralSettings, say: Progress
) -> tuple[Base, ChainsFit | None]:
    if settings.base == "uniform":
        return UniformBase(space), None
    found = fit_chains(
        space,
        train,
        validation,
        components=settings.components,
        members=settings.members,
        seconds=settings.seconds / 2,
        seed=settings.seed,
        watch=lambda share, what: say(share / 2, what),
    )
    return found.mixture, found


class _Trainer:
    """Adam with a cosine rate and averaged weights, in float32; looks at the validation points."""

    def __init__(
        self,
        density: SymmetricDensity,
        train: Tensor,
        validation: Tensor,
        settings: NeuralSettings,
        generator: torch.Generator,
        say: Progress,
        budget: Budget,
    ) -> None:
        self.density, self.settings, self.say = density, settings, say
        self.train, self.validation = train.float(), validation.float()
        self.generator = generator
        self.budget = budget
        self.idle = self.late = False

    def match(self) -> float:
        """Flow matching; the validation NLL after it."""
        count = self.settings.matchings
        if not count:
            return self._score()
        # half of what is left; the likelihood costs more but gains more
        half = Budget(seconds=self.budget.seconds_left / 2)
        rate = self.settings.matching_rate
        done = self._descend(self._matching_loss, count, rate, half, "matching", keep=0.999)
        self.late = half.is_late
        return done.validation[done.best]

    def refine(self) -> Refinement:
        """Descent on the exact negative log-likelihood; what gains too little is undone."""
        count, rate = self.settings.refinement, self.settings.refinement_rate
        done = self._descend(self._nll, count, rate, self.budget, "likelihood", keep=0.98)
        gain = done.validation[0] - done.validation[done.best]
        if self.settings.base == "mixture" and not self.settings.matchings and gain < WORTHWHILE:
            self.idle = True
            # a new field is zero, and this one costs next to nothing
            still = NeuralTorusField(self.density.space.dim, width=1, depth=1, waves=1)
            self.density.flow = NeuralFlow(still, steps=1)
        return done

    def _batch(self) -> Tensor:
        chosen = torch.randint(len(self.train), (self.settings.batch,), generator=self.generator)
        return self.train[chosen]

    def _matching_loss(self) -> Tensor:
        end, space = self._batch(), self.density.space
        start = self.density.base.sample(len(end), self.generator).to(end)
        if self.settings.paired:
            start, move = coupled(space, start, end)
        else:
            move = space.displacement(start, end)
        now = torch.rand(len(end), 1, generator=self.generator)
        return (self._field(start + now * move, now) - move).square().sum(dim=-1).mean()

    def _nll(self) -> Tensor:
        return -self.density.log_prob(self._batch()).mean()

    @property
    def _field(self) -> NeuralTorusField:
        field = self.density.flow.field
        assert isinstance(field, NeuralTorusField)  # by construction
        return field

    @torch.no_grad()
    def _score(self) -> float:
        # at doubled steps: what only exploits the integrator gains nothing here
        finer = self.density.with_steps(2 * self.density.flow.steps)
        return -float(finer.log_prob(self.validation).mean())

    def _descend(
        self,
        loss: Callable[[], Tensor],
        count: int,
        rate: float,
        budget: Budget,
        what: str,
        *,
        keep: float,
    ) -> Refinement:
        """`count` iterations; leaves the averaged weights that were best on the validation points."""
        field, began = self._field, time.monotonic()
        optimizer = adam(field.parameters(), lr=rate, betas=(0.9, 0.99))
        mean = copy.deepcopy(field.state_dict())
        last = math.nan
        trains, scores, best, kept = [last], [self._score()], 0, copy.deepcopy(mean)
        stopped = "iterations"
        for iteration in range(count):
            late = budget.is_spent
            if not late:
                _set_rate(optimizer, rate, iteration, count)
                value = loss()
                optimizer.zero_grad()
                torch.autograd.backward(value)
                torch.nn.utils.clip_grad_norm_(field.parameters(), CLIP)
                optimizer.step()
                # early on, an average over all so far
                _average(mean, field.state_dict(), min(keep, (1 + iteration) / (10 + iteration)))
                last = float(value.detach())
                if (iteration + 1) % max(1, count // LOOKS) and iteration + 1 < count:
                    continue
            trains.append(last)
            scores.append(self._score_of(mean))
            if scores[-1] < scores[best] or not math.isfinite(scores[best]):
                best, kept = len(scores) - 1, copy.deepcopy(mean)
            self.say((iteration + 1) / count, f"{what}: validation {scores[-1]:.4f}")
            if late:
                stopped = "time"
                break
            if len(scores) - 1 - best >= PATIENCE:
                stopped = "validation"
                break
        field.load_state_dict(kept)
        seconds = time.monotonic() - began
        return Refinement(tuple(trains), tuple(scores), best, stopped, seconds)

    def _score_of(self, weights: dict[str, Tensor]) -> float:
        field = self._field
        now = copy.deepcopy(field.state_dict())
        field.load_state_dict(weights)
        score = self._score()
        field.load_state_dict(now)
        return score


def _set_rate(optimizer: torch.optim.Optimizer, rate: float, iteration: int, count: int) -> None:
    warm = min(1.0, (iteration + 1) / WARM)
    optimizer.param_groups[0]["lr"] = rate * warm * (1 + math.cos(math.pi * iteration / count)) / 2


@torch.no_grad()
def _average(mean: dict[str, Tensor], now: dict[str, Tensor], keep: float) -> None:
    for name, value in now.items():
        mean[name].lerp_(value, 1 - keep)


def _notes(mixture: ChainsFit | None, trainer: _Trainer) -> list[str]:
    notes: list[str] = []
    if mixture is not None:
        notes.append(
            f"the base is the mean of {mixture.members} mixtures of {mixture.components} components"
        )
    if trainer.idle:
        notes.append(
            f"the flow gained less than {WORTHWHILE} nats over its base on the validation points and "
            "was left at the identity"
        )
    struck = mixture is not None and mixture.late
    if struck or trainer.late or trainer.budget.is_late:
        seconds = trainer.settings.seconds
        notes.append(f"stopped by the limit of {seconds:g} s: another run may differ")
    return notes
