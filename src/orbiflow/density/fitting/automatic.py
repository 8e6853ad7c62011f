"""A density that chooses its parts by rows held out: flow, kernels, mixtures, chains, network."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.arguments import (
    check_kind,
    check_range,
    silent,
)
from orbiflow.density.fitting.assembly import assembled
from orbiflow.density.fitting.budget import Budget, training
from orbiflow.density.fitting.evidence import (
    Candidates,
    candidates_of,
    judged,
    without_idle,
)
from orbiflow.density.fitting.families import (
    ChainFamily,
    Family,
    KernelFamily,
    MixtureFamily,
    NetworkFamily,
)
from orbiflow.density.fitting.flow_trial import (
    TriedFlow,
    flow_settings,
    try_flow,
)
from orbiflow.density.fitting.folds import (
    LEAST_PLACES,
    Folds,
    Repeats,
    folds_of,
    repeats_of,
)
from orbiflow.density.fitting.kernels import NARROWEST
from orbiflow.density.fitting.report import (
    FitReport,
    PartEvidence,
    Progress,
    mean_nll,
    own_points,
    steps_note,
)
from orbiflow.density.fitting.rows import (
    MARGINAL_PARTS,
    Rows,
    check_missing,
    effective_rows,
    group_numbers,
    is_whole,
    mean_of,
    missing_notes,
    observed_points,
    weighed,
    weights_note,
    weights_of,
)
from orbiflow.density.fitting.settings import FitSettings
from orbiflow.density.fitting.weights import stacked, supported_weights
from orbiflow.density.inference import at_observed
from orbiflow.density.models import MOST_DIM, BlendedDensity
from orbiflow.density.spaces import (
    Space,
    Torus,
    whole_turn,
)
from orbiflow.errors import OrbiflowError
from orbiflow.typed_torch import listed

PARTS = ("flow", "kernels", "mixture", "chains", "network")
"""What a density may be made of, beside its uniform floor."""

REPEATS = ("places", "rounding")
"""What rows that repeat another are taken for."""

LEAST_FLOW_ROWS = 300
"""With fewer, a flow is not tried: none has gained anything."""

MEMBERS = 12
"""Chains of one size on tori of four or more angles, all folds together."""

SCORED = 2_000
"""Rows over which the report's mean log density is taken: each costs all kernels."""

BEFORE_FLOW, BEFORE_END = 0.7, 0.95
"""Of the work told: before a flow, if one is tried, and before all is put together."""


@dataclass(frozen=True)
class AutomaticSettings:
    """What there is to choose of a fit that chooses by itself.

    - `parts`: of `PARTS`, those that may be used; chains are for tori of two or more angles, a flow for
      spaces of three dimensions at most, a network for tori of more.
    - `repeats`: "places": new rows repeat the old ones as often as these repeat each other; "rounding":
      repeated values are an accident, and the density is to have no peaks at them.
    - `missing`: "refuse" points that lack angles (NaN), or "marginalise": on tori a row counts by the
      density of the angles that it has, and the parts are kernels and mixtures.
    - `flow`: its settings; None for what suits the number of rows.
    - `seconds`: after which nothing further is tried; a fit that it ends depends on the machine.
    - `seed`: of the folds and the starts.
    """

    parts: tuple[str, ...] = PARTS
    repeats: str = "places"
    missing: str = "refuse"
    flow: FitSettings | None = None
    seconds: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        unknown = [part for part in self.parts if part not in PARTS]
        if unknown or not self.parts:
            raise OrbiflowError(f"parts must be of {', '.join(PARTS)}, got {self.parts!r}")
        if self.repeats not in REPEATS:
            raise OrbiflowError(
                f"repeats must be one of {', '.join(REPEATS)}, got {self.repeats!r}"
            )
        check_missing(self.missing)
        check_range("seconds", self.seconds, 0, math.inf)
        check_range("seed", self.seed, -(2**63), 2**64 - 1, integer=True)


@training()
def fit_automatic(
    space: Space,
    points: Tensor,
    settings: AutomaticSettings | None = None,
    *,
    weights: Any = None,
    groups: ArrayLike | None = None,
    progress: Progress | None = None,
) -> tuple[BlendedDensity, FitReport]:
    """Fit what suits the data best: a mixture of densities with weights by rows held out.

    Kernel estimates of many widths, mixtures and von Mises chains of many sizes and, of many angles, a
    network are fitted to the rows without a tenth, and judged by that tenth, for several tenths in
    turn; the weights that suit the rows held out best (stacking: Smyth and Wolpert, 1999) are those of
    the density, in which kernels are about all rows and the others the mean of those of the folds. A
    flow, fitted without the first tenth, is blended in if that tenth says so.

    Args:
        space: any.
        points: (N, d) in the chart, N >= 10 different ones.
        settings: default `AutomaticSettings()`.
        weights: of the points (N,), at least 0; only their ratios count; default equal.
        groups: a label (N,) a point: those of one are held out together, so that parts are chosen for
            rows of new groups. Default: each point is by itself.
        progress: told how far it is.

    Returns:
        The density, float64, and the report, with the evidence on each part.

    Raises:
        OrbiflowError: for points of another shape or too few, or parts that the space does not have.
    """
    settings = AutomaticSettings() if settings is None else settings
    check_kind(settings, AutomaticSettings, "settings")
    say = progress or silent
    budget = Budget(seconds=settings.seconds)
    rows, settings, notes = _rows(space, points, weights, groups, settings)
    found = repeats_of(space, rows[is_whole(rows)].points)
    whole = " that lack no angle" if found.places + found.rows < len(rows) else ""
    if found.places < LEAST_PLACES:
        raise OrbiflowError(
            f"a density needs at least {LEAST_PLACES} different points{whole}, got {found.places} "
            f"among {len(rows)}"
        )
    generator = torch.Generator().manual_seed(settings.seed)
    folds = folds_of(rows, together=settings.repeats == "rounding", generator=generator)
    families = _families(space, folds, settings, found)
    flows = _wants_flow(space, folds, settings)
    before = BEFORE_FLOW if flows else BEFORE_END
    candidates = candidates_of(
        space, families, folds, lambda done, what: say(before * done, what), budget
    )
    weights = supported_weights(candidates.table, candidates.floor, candidates.row_weights)
    if space.dim > MOST_DIM:  # each part makes integrals dearer
        weights = without_idle(candidates, weights)
    tried = TriedFlow()
    if flows and not budget.is_spent:
        tried = _try_flow(space, folds, candidates, weights, settings, budget, say)
    say(BEFORE_END, "putting together")
    density = assembled(space, families, candidates, weights, folds.rows, tried.flow, tried.share)
    parts = (*tried.evidence, *_shrunk(judged(candidates, weights), tried.share))
    return density, _report(
        density, folds, candidates, weights, tried, parts, found, settings, budget, notes
    )


def _rows(
    space: Space, points: Any, weights: Any, groups: ArrayLike | None, settings: AutomaticSettings
) -> tuple[Rows, AutomaticSettings, list[str]]:
    """Rows that say anything, the parts that can be fitted to them, and what to say of it."""
    if settings.missing == "refuse":
        own = own_points(space, points)
        labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(own)))
        return weighed(own, weights, labels), settings, []
    own, known = observed_points(space, points)
    labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(known)))[known]
    rows = weighed(own, None if weights is None else weights_of(weights, known), labels)
    if not bool(rows.points.isnan().any()):
        return rows, settings, missing_notes(rows, int((~known).sum()))
    chosen = tuple(part for part in settings.parts if part in MARGINAL_PARTS)
    if not chosen or (settings.parts != PARTS and chosen != settings.parts):
        raise OrbiflowError(
            f"{' and '.join(part for part in settings.parts if part not in MARGINAL_PARTS)} cannot be "
            "fitted to rows that lack angles: choose of kernels and mixture, or leave those rows out"
        )
    return rows, replace(settings, parts=chosen), missing_notes(rows, int((~known).sum()))


def _families(
    space: Space, folds: Folds, settings: AutomaticSettings, found: Repeats
) -> list[Family]:
    rounding = settings.repeats == "rounding"
    narrowest = _narrowest(space, found.step) if rounding else NARROWEST
    starts = max(1, round(MEMBERS / folds.used)) if space.dim > MOST_DIM else 1
    families: list[Family] = [
        KernelFamily(space, narrowest, repeats=not rounding),
        MixtureFamily(space, settings.seed, narrowest),
    ]
    if space.is_torus and space.dim > 1:
        families.append(ChainFamily(space, settings.seed, starts))
    if isinstance(space, Torus) and space.dim > MOST_DIM:
        families.append(NetworkFamily(space, settings.seed))
    chosen = [family for family in families if family.name in settings.parts]
    beside = "flow" in settings.parts and settings.parts not in (PARTS, ("flow",))
    if beside and space.dim > MOST_DIM:
        raise OrbiflowError(
            f"on a torus of {space.dim} angles a flow stands alone: leave it out of the parts, or all "
            "others"
        )
    if not chosen and (space.dim > MOST_DIM or settings.parts != ("flow",)):
        raise OrbiflowError(
            f"a density on this {type(space).__name__} of {space.dim} dimensions cannot be made of "
            f"{' and '.join(settings.parts)} alone: chains are for tori of two angles or more, a "
            f"network for more than {MOST_DIM}, a flow for {MOST_DIM} at most"
        )
    return chosen


def _narrowest(space: Space, step: float | None) -> float:
    """Concentration of kernels of a deviation of one step of rounding."""
    if step is None:
        return NARROWEST
    if space.is_round:
        angle = math.radians(step) if space.settings()["form"] == "latlon" else step
    else:
        angle = 2 * math.pi * step / whole_turn(str(space.unit))
    return min(NARROWEST, 1 / angle**2)


def _wants_flow(space: Space, folds: Folds, settings: AutomaticSettings) -> bool:
    enough = len(folds.rows) >= LEAST_FLOW_ROWS or settings.parts == ("flow",)
    return "flow" in settings.parts and space.dim <= MOST_DIM and enough


def _untried_note(space: Space, folds: Folds, settings: AutomaticSettings) -> list[str]:
    """What to say where a flow was meant, and not only one of all parts, and none was tried."""
    meant = "flow" in settings.parts and (settings.flow is not None or settings.parts != PARTS)
    if not meant or _wants_flow(space, folds, settings):
        return []
    return [
        f"no flow was tried: of fewer than {LEAST_FLOW_ROWS} rows, here {len(folds.rows)}, none has "
        "gained anything"
    ]


def _try_flow(
    space: Space,
    folds: Folds,
    candidates: Candidates,
    weights: Tensor,
    settings: AutomaticSettings,
    budget: Budget,
    say: Progress,
) -> TriedFlow:
    chosen = settings.flow or flow_settings(space, len(folds.rows), settings.seed)
    return try_flow(
        space, folds, candidates, weights, chosen, budget,
        lambda done, what: say(BEFORE_FLOW + (BEFORE_END - BEFORE_FLOW) * done, what),
    )  # fmt: skip


def _shares_of(folds: Folds) -> str:
    """Of the rows, in words."""
    if folds.rows.groups is None:
        return "of a tenth each"
    count = len(folds.rows.groups.bincount().nonzero())
    return f"of whole groups, of which there are {count}"


def _shrunk(parts: list[PartEvidence], flow: float) -> list[PartEvidence]:
    """Beside a flow of this share."""
    return [replace(part, share=part.share * (1 - flow)) for part in parts]


def _report(
    density: BlendedDensity,
    folds: Folds,
    candidates: Candidates,
    weights: Tensor,
    tried: TriedFlow,
    parts: tuple[PartEvidence, ...],
    found: Repeats,
    settings: AutomaticSettings,
    budget: Budget,
    notes: list[str],
) -> FitReport:
    own_weights = candidates.row_weights
    held = mean_of(stacked(candidates.table, weights), own_weights)
    held += sum(part.gain for part in parts if part.name == "flow")
    flow = tried.report if tried.share else None
    error = flow.integration_error if flow else 0.0
    total = candidates.table.shape[1]
    chosen = [
        f"chosen by {total} rows held out, in {folds.used} parts {_shares_of(folds)}: "
        f"{held - mean_of(candidates.table[-1], own_weights):.4f} nats above uniform",
        *map(str, parts),
    ]
    some = folds.rows[:SCORED]
    mass = None
    if density.space.dim == 2:
        mass = density.mass_with(flow.mass) if flow and flow.mass is not None else 1.0
    return FitReport(
        points=len(folds.rows),
        duplicates=found.rows,
        train=len(folds.rows),
        validation=total,
        start_nll=-mean_of(candidates.table[-1], own_weights),
        train_nll=-mean_of(at_observed(density, some.points), some.weights)
        if notes
        else mean_nll(density, some.points, some.weights),
        validation_nll=-held,
        stages=flow.stages if flow else (),
        steps=density.flow.steps,
        mass=mass,
        integration_error=error,
        shares=tuple(listed(density.shares)),
        parts=parts,
        repeats=found,
        effective=None if folds.rows.weights is None else effective_rows(folds.rows.weights),
        notes=(
            *notes,
            *weights_note(folds.rows),
            *chosen,
            *_untried_note(density.space, folds, settings),
            *found.notes(settings.repeats),
            *budget.notes(),
            *steps_note(density, error),
        ),
    )
