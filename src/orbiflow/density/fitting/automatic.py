"""A density that chooses its parts by rows held out: flow, kernels, mixtures, chains, network."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import torch
from numpy.typing import ArrayLike
from torch import Tensor

from orbiflow.density.data import alongside, group_numbers
from orbiflow.density.fitting.evidence import (
    Candidates,
    Course,
    Evidence,
    candidates_of,
    judged,
    without_idle,
    work_of,
)
from orbiflow.density.fitting.families import (
    ChainFamily,
    Family,
    KernelFamily,
    MixtureFamily,
    NetworkFamily,
    ParametricFamily,
    ProductChainFamily,
)
from orbiflow.density.fitting.flow import Outdone, fit_density
from orbiflow.density.fitting.flow_trial import (
    FittedFlow,
    TriedFlow,
    flow_beside,
    flow_settings,
    outdone_by,
    try_flow,
)
from orbiflow.density.fitting.held_out import (
    LEAST_PLACES,
    Folds,
    folds_of,
    stacked,
    supported_weights,
)
from orbiflow.density.fitting.kernels import limit_notes, narrowest_for
from orbiflow.density.fitting.likelihood import training
from orbiflow.density.fitting.parametric import fit_parametric, require_family
from orbiflow.density.fitting.repeats import Repeats, repeats_of, spread_evenly
from orbiflow.density.fitting.report import (
    ComponentEvidence,
    FitReport,
    Progress,
    mean_nll,
    own_points,
    silent,
    steps_note,
)
from orbiflow.density.fitting.rows import (
    MARGINAL_PARTS,
    Rows,
    check_missing,
    effective_rows,
    is_whole,
    lone_groups_note,
    mean_of,
    missing_notes,
    observed_points,
    weighed,
    weights_note,
    weights_of,
)
from orbiflow.density.fitting.settings import COMPONENTS, PARAMETRIC, DensitySettings
from orbiflow.density.models import MOST_BESIDE, MOST_DIM, Density, Mixture, flow_obstacle
from orbiflow.density.spaces import ProductSpace, Space, Torus
from orbiflow.errors import DataWarning, OrbiflowError
from orbiflow.runtime import SideBySide
from orbiflow.settings import as_instance

SURFACE_DIM = 2
"""The dimension of spaces on which a flow is tried without being asked for."""

LEAST_FLOW_ROWS = 300
"""With fewer, a flow is not tried: on no data has one gained anything."""

CHAINS_PER_SIZE = 12
"""Chains of one size on tori of four or more angles, all folds together."""

MAX_SCORED_ROWS = 2_000
"""Rows over which the report's mean log density is taken: each costs all kernels."""

FLOW_WORK = 4.0
"""Work of fits of a flow, in that of a family in a fold after the first."""

BEFORE_END = 0.95
"""Of the work told, before all is put together."""


@dataclass(frozen=True)
class ChosenFit:
    """A density, the report of its fit, and what held-out rows were judged by.

    - `folds`: The rows in random order; None of a parametric family or a flow alone, which have none.
    - `evidence`: What was fitted to all folds but one, for each of them.
    """

    density: Density
    report: FitReport
    folds: Folds | None = None
    evidence: Evidence | None = None

    def without(self, fold: int) -> Density:
        """Return what the density is, without a flow, of all rows but those of a fold."""
        assert self.evidence is not None
        return self.evidence.without(fold)


def fit_chosen(
    space: Space,
    points: Tensor,
    settings: DensitySettings,
    *,
    missing: str = "refuse",
    weights: Any = None,
    groups: ArrayLike | None = None,
    columns: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> ChosenFit:
    """Fit what the settings ask for: a parametric family, a flow alone, or what suits the data best.

    Arguments are those of `fit_automatic`, and `columns` those of `fit_parametric`.
    """
    if settings.parametric:
        how: dict[str, Any] = {"groups": groups, "columns": columns, "seed": settings.seed}
        fit = fit_parametric(space, points, settings.parametric, weights=weights, **how)
        return ChosenFit(*fit)
    if settings.flow_alone:
        fit = fit_density(space, points, settings.flow, weights=weights, progress=progress)
        return ChosenFit(*fit)
    how = {"missing": missing, "weights": weights, "groups": groups, "progress": progress}
    return fit_in_folds(space, points, settings, **how)


def fit_automatic(
    space: Space,
    points: Tensor,
    settings: DensitySettings | None = None,
    *,
    missing: str = "refuse",
    weights: Any = None,
    groups: ArrayLike | None = None,
    progress: Progress | None = None,
) -> tuple[Mixture, FitReport]:
    """Fit what suits the data best: a mixture of densities with weights by rows held out.

    Kernel estimates of many widths, mixtures and von Mises chains of many sizes and, of many angles, a
    network are fitted to the rows without a tenth, and judged by that tenth, for several tenths in
    turn; the weights that suit the rows held out best (stacking: Smyth and Wolpert, 1999) are those of
    the density, in which kernels are about all rows and the others the mean of those of the folds. A
    flow, fitted without the first tenth, is blended in if that tenth says so.

    Points (N, d) are in the chart; of `weights` (N,) only the ratios count. Points of one label of
    `groups` (N,) are held out together, so that parts are chosen for rows of new groups. `missing` says
    to "refuse" points that lack angles (NaN), or to "marginalise": on tori a row counts by the density
    of the angles that it has, and the components are kernels and mixtures. The density is float64.

    Warns:
        DataWarning: If repeated values are taken for an accident of rounding without being told so, or
            rows are closer together than kernels can be narrow.
    """
    settings = DensitySettings() if settings is None else settings
    as_instance(settings, DensitySettings, "settings")
    how: dict[str, Any] = {"weights": weights, "groups": groups, "progress": progress}
    fit = fit_in_folds(space, points, settings, missing=missing, **how)
    assert isinstance(fit.density, Mixture)
    return fit.density, fit.report


@training()
def fit_in_folds(
    space: Space,
    points: Tensor,
    settings: DensitySettings,
    *,
    missing: str = "refuse",
    weights: Any = None,
    groups: ArrayLike | None = None,
    folds: Folds | None = None,
    progress: Progress | None = None,
) -> ChosenFit:
    """Fit as `fit_automatic`; return also what held-out rows were judged by.

    With `folds` the points are of their rows, in their order, and are weighed and held out alike.
    """
    say = progress or silent
    rows, settings, notes = _rows(space, points, weights, groups, settings, check_missing(missing))
    if folds is not None:
        rows = replace(folds.rows, points=rows.points)
    repeats = repeats_of(space, rows[is_whole(rows)].points)
    whole = " that lack no angle" if repeats.places + repeats.rows < len(rows) else ""
    taken_for = repeats.taken_for(settings.repeats)
    if repeats.places < LEAST_PLACES and not (taken_for == "rounding" and repeats.can_be_undone):
        raise OrbiflowError(
            f"a density needs at least {LEAST_PLACES} different points{whole}, got {repeats.places} "
            f"among {len(rows)}"
        )
    together = taken_for == "rounding" and not repeats.can_be_undone
    if taken_for == "rounding" and repeats.can_be_undone:  # as they may have been before
        noise = torch.Generator().manual_seed(settings.seed)
        rows = replace(rows, points=spread_evenly(space, rows.points, repeats, noise))
    if folds is None:
        generator = torch.Generator().manual_seed(settings.seed)
        how: dict[str, Any] = {"generator": generator, "fast": settings.is_fast}
        folds = folds_of(rows, together=together, **how)
    else:
        folds = replace(folds, rows=rows)
    narrowest, crowded = narrowest_for(space, rows[is_whole(rows)].points)
    limited = limit_notes(space, crowded)
    if together and repeats.step is not None:  # a deviation of one step
        narrowest = min(narrowest, 1 / space.step_angle(repeats.step) ** 2)
    families = _families(space, folds, settings, together, narrowest)
    flows = _is_flow_tried(space, folds, settings)
    total = work_of(len(families), folds.used) + FLOW_WORK * flows
    course = Course(lambda done, what: say(BEFORE_END * done, what), total)
    with SideBySide() as beside:
        flow_fits: list[Callable[[int], FittedFlow]] = []

        def meet(others: Tensor, uniform: Tensor, held: Rows) -> None:
            if flows:
                outdone = outdone_by(others, uniform, held)
                flow_fits.append(_flow_fits(space, folds, settings, outdone, course, beside))

        candidates = candidates_of(space, families, folds, course, beside, meet)
        weights = supported_weights(candidates.table, candidates.floor, candidates.row_weights)
        weights = without_idle(candidates, weights)  # each part costs time at every query
        others = judged(candidates, weights)  # while the flow is fitted
        tried = TriedFlow()
        if flow_fits:
            tried = try_flow(folds, candidates, weights, flow_fits[0])
    say(BEFORE_END, "putting together")
    evidence = Evidence.of(space, families, candidates, folds.rows, weights)
    density = evidence.assembled(tried.flow, tried.share)
    rest = 1 - tried.share
    parts = (*tried.evidence, *(replace(part, share=part.share * rest) for part in others))
    report = _report(density, folds, candidates, weights, tried, parts, repeats)
    for note in (*repeats.warnings(settings.repeats), *limited):
        warnings.warn(note, DataWarning, stacklevel=7)
    after = (
        *weights_note(folds.rows),
        *lone_groups_note(folds.rows.groups),
        *report.notes,
        *_untried_note(folds, settings, flows),
        *settings.left_out,
        *repeats.notes(taken_for),
        *limited,
        *steps_note(report.steps, report.integration_error),
    )
    report = replace(report, notes=(*notes, *after))
    return ChosenFit(density, report, folds, evidence)


def _is_flow_tried(space: Space, folds: Folds, settings: DensitySettings) -> bool:
    """Return whether a flow is fitted.

    In one and in three dimensions only if it is asked for: on fifteen sets of one column it gained
    nothing, on as many of three nothing or .002 nats, and of 40,000 rows .006.
    """
    asked = settings.components is not None or settings.of_flow
    if "flow" not in settings.allowed or flow_obstacle(space):
        return False
    if space.dim != SURFACE_DIM and not asked:
        return False
    return len(folds.rows) >= LEAST_FLOW_ROWS or settings.allowed == ("flow",)


def _flow_fits(
    space: Space,
    folds: Folds,
    settings: DensitySettings,
    outdone: Outdone,
    course: Course,
    beside: SideBySide,
) -> Callable[[int], FittedFlow]:
    """Begin to fit a flow without the first tenth; return the fits without the first and the second.

    The first is given up where it is `outdone`.
    """
    chosen = flow_settings(space, len(folds.rows), settings.seed).replace(**settings.of_flow)
    tell = course.part(FLOW_WORK)

    def begun(number: int) -> Callable[[], FittedFlow]:
        fit = partial(flow_beside, space, folds, number, chosen, None if number else outdone)
        return beside.begin(fit, tell)

    first = begun(0)
    return lambda number: begun(number)() if number else first()


def _rows(
    space: Space,
    points: Any,
    weights: Any,
    groups: ArrayLike | None,
    settings: DensitySettings,
    missing: str,
) -> tuple[Rows, DensitySettings, list[str]]:
    """Rows that say anything, the parts that can be fitted to them, and what to say of it."""
    points, weights, groups = alongside(points=points, weights=weights, groups=groups)
    if missing == "refuse":
        canonical = own_points(space, points)
        labels = None if groups is None else torch.as_tensor(group_numbers(groups, len(canonical)))
        return weighed(canonical, weights, labels), settings, []
    canonical, has_any = observed_points(space, points)
    labels = (
        None if groups is None else torch.as_tensor(group_numbers(groups, len(has_any)))[has_any]
    )
    kept_weights = None if weights is None else weights_of(weights, len(has_any))[has_any]
    rows = weighed(canonical, kept_weights, labels)
    notes = missing_notes(rows, int((~has_any).sum()))
    if not bool(rows.points.isnan().any()):
        return rows, settings, notes
    chosen = tuple(part for part in settings.allowed if part in MARGINAL_PARTS)
    if not chosen or (settings.allowed != COMPONENTS and chosen != settings.allowed):
        raise OrbiflowError(
            f"{' and '.join(name for name in settings.allowed if name not in MARGINAL_PARTS)} cannot "
            "be fitted to rows that lack angles: choose among kernels and mixture, or leave out those "
            "rows"
        )
    settings = settings.replace(components=chosen, max_frequency=None, segments=None)
    return rows, settings, notes


def _families(
    space: Space, folds: Folds, settings: DensitySettings, together: bool, narrowest: float
) -> list[Family]:
    starts = max(1, round(CHAINS_PER_SIZE / folds.used)) if space.dim > MOST_DIM else 1
    families: list[Family] = [
        KernelFamily(space, narrowest, repeats=not together),
        MixtureFamily(space, settings.seed, narrowest),
    ]
    if space.is_torus and space.dim > 1:
        families.append(ChainFamily(space, settings.seed, starts=starts))
    if isinstance(space, ProductSpace) and space.beside.dim <= MOST_BESIDE:
        families.append(ProductChainFamily(space, settings.seed, narrowest))
    if isinstance(space, Torus) and space.dim > MOST_DIM:
        families.append(NetworkFamily(space, settings.seed))
    named = [name for name in settings.allowed if name in PARAMETRIC]
    for name in named:
        require_family(space, name)
    families += [ParametricFamily(space, name) for name in named]
    chosen = [family for family in families if family.name in settings.allowed]
    beside = "flow" in settings.allowed and settings.allowed not in (COMPONENTS, ("flow",))
    obstacle = flow_obstacle(space)
    if beside and obstacle:
        raise OrbiflowError(f"{obstacle}: leave it out of the parts")
    if not chosen and (obstacle or settings.allowed != ("flow",)):
        raise OrbiflowError(
            f"a density on this {type(space).__name__} of {space.dim} dimensions cannot be made of "
            f"{' and '.join(settings.allowed)} alone: chains are for tori of two angles or more, a "
            f"network for more than {MOST_DIM}, a flow for {MOST_DIM} at most"
        )
    return chosen


def _untried_note(folds: Folds, settings: DensitySettings, flows: bool) -> list[str]:
    """What to say where a flow was meant, and not only one of all parts, and none was tried."""
    meant = "flow" in settings.allowed and (settings.of_flow or settings.allowed != COMPONENTS)
    if flows or not meant:
        return []
    rows = f"with fewer than {LEAST_FLOW_ROWS} rows, here {len(folds.rows)}, none gains anything"
    return [f"no flow was tried: {rows}"]


def _report(
    density: Mixture,
    folds: Folds,
    candidates: Candidates,
    weights: Tensor,
    tried: TriedFlow,
    parts: tuple[ComponentEvidence, ...],
    found: Repeats,
) -> FitReport:
    """Return what was done, with notes on how it was chosen."""
    own_weights = candidates.row_weights
    held = mean_of(stacked(candidates.table, weights), own_weights)
    held += sum(part.gain for part in parts if part.name == "flow")
    flow = tried.report if tried.share else None
    total = candidates.table.shape[1]
    uniform = mean_of(candidates.table[-1], own_weights)
    shares = "of a tenth each"
    if folds.rows.groups is not None:
        count = len(folds.rows.groups.bincount().nonzero())
        shares = f"of whole groups, of which there are {count}"
    chosen = [
        f"chosen by {total} rows held out, in {folds.used} parts {shares}: "
        f"{held - uniform:.4f} nats above uniform",
        *map(str, parts),
    ]
    some = folds.rows[:MAX_SCORED_ROWS]
    mass = None
    if density.space.dim == 2:
        mass = 1.0
        if flow and flow.mass is not None:
            mass = tried.share * flow.mass + 1 - tried.share
    return FitReport(
        points=len(folds.rows),
        duplicates=found.rows,
        train=len(folds.rows),
        validation=total,
        start_nll=-uniform,
        train_nll=mean_nll(density, some.points, some.weights),
        validation_nll=-held,
        stages=flow.stages if flow else (),
        steps=flow.steps if flow else 1,
        mass=mass,
        integration_error=flow.integration_error if flow else 0.0,
        weights=density.weight_of_kind,
        components=parts,
        repeats=found,
        effective=None if folds.rows.weights is None else effective_rows(folds.rows.weights),
        notes=tuple(chosen),
    )
