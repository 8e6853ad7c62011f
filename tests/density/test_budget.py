"""What a fit may spend, and whether a flow belongs beside other parts."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
import torch

import orbiflow.density as od
from density.blends import two_clusters
from orbiflow.density.fitting import Folds, Rows, folds_of, stacked
from orbiflow.density.fitting.automatic import BEFORE_END
from orbiflow.density.fitting.evidence import Candidates, Course, candidates_of, judged
from orbiflow.density.fitting.families import KernelFamily
from orbiflow.density.fitting.flow_trial import (
    FIRST_TENTH_SHARE,
    TriedFlow,
    flow_beside,
    outdone_by,
    try_flow,
)
from orbiflow.density.fitting.held_out import supported_weights
from orbiflow.density.fitting.likelihood import ITERATIONS_PER_SCORE, refine
from orbiflow.density.fitting.report import ComponentEvidence
from orbiflow.density.fitting.rows import Gain
from orbiflow.density.fitting.settings import Component
from orbiflow.fields import SplineField
from orbiflow.flows import Flow
from orbiflow.runtime import SideBySide, one_core

SMALL: dict[str, Any] = {"max_frequency": 2, "segments": 2, "roughness": (1e-3,)}


def cluster(name: str, count: int = 200) -> torch.Tensor:
    """Chart points about (20, 60) degrees."""
    rng = np.random.default_rng(0)
    unit = {"unit": "degrees"} if name in ("torus", "klein-bottle") else {}
    table = rng.normal([20.0, 60.0], 15.0, (count, 2)).clip(-89, 89)
    return od.make_space(name, **unit).to_chart(table)


def test_the_same_evaluations_give_the_same_density() -> None:
    space, points, values = od.make_space("sphere"), cluster("sphere", 60), []
    how = {**SMALL, "segments": 1}
    for seed in (0, 0, 1):
        settings = od.FlowSettings(**how, evaluations=12, seed=seed)
        density, report = od.fit_density(space, points, settings)
        assert report.notes == ("stopped by the budget of 12 evaluations",)
        assert 12 <= sum(stage.evaluations for stage in report.stages) < 24
        with torch.no_grad():
            values.append(density.log_prob(points))
    assert torch.equal(*values[:2])
    assert not torch.equal(*values[1:])


@pytest.mark.parametrize("iterations", [0, 1, 4, 5])
def test_every_last_iterate_is_scored(iterations: int) -> None:
    points = cluster("torus").float()
    space = od.make_space("torus")
    fields = [SplineField(space.group, 2, smoothness=2.0, dtype=torch.float32)]
    density = od.FlowDensity(space, Flow(fields, steps=2, warn=False))
    before = fields[0].parameters_.detach().clone()
    done = refine(density, Rows(points), Rows(points), iterations=iterations)
    assert len(done.validation) == 1 + math.ceil(iterations / ITERATIONS_PER_SCORE)
    # train and validation are the same points: every iterate is better than the one before
    assert done.best == len(done.validation) - 1
    assert torch.equal(fields[0].parameters_, before) is (iterations == 0)
    assert iterations == 0 or done.validation[-1] < done.validation[0] - 0.05


QUICK: dict[str, Any] = {
    "max_frequency": 2, "segments": 2, "iterations": 10, "roughness": (1e-3,)
}  # fmt: skip
SPACE = od.Torus(2)


def evidence(weights: np.ndarray | None = None) -> tuple[Folds, Candidates, torch.Tensor]:
    """Kernels of two broad clusters, judged by a fifth of 700 rows."""
    folds = folds_of(
        od.weighed(two_clusters(SPACE, 700), weights),
        together=False,
        generator=torch.Generator().manual_seed(0),
    )
    with one_core():
        course = Course(lambda *_: None, 1.0)
        candidates = candidates_of(
            SPACE, [KernelFamily(SPACE)], folds, course, SideBySide(), lambda *_: None
        )
    return (
        folds,
        candidates,
        supported_weights(candidates.table, candidates.floor, candidates.row_weights),
    )


def tried(
    folds: Folds, candidates: Candidates, weights: torch.Tensor, told=lambda *_: None
) -> TriedFlow:
    settings = od.FlowSettings(**QUICK)
    return try_flow(
        folds, candidates, weights, lambda k: flow_beside(SPACE, folds, k, settings, None, told)
    )


@pytest.mark.parametrize("tenths", [1, 2])
def test_progress_goes_on_from_one_tenth_to_the_next(tenths: int, monkeypatch) -> None:
    monkeypatch.setattr(Gain, "is_sure", property(lambda _: tenths == 1))
    monkeypatch.setattr("orbiflow.density.fitting.flow_trial._is_worth_it", lambda _: True)
    said: list[tuple[float, str]] = []
    tried(*evidence(), told=lambda done, what: said.append((done, what)))
    shares = [done for done, _ in said]
    assert shares == sorted(shares)
    assert [done for done, what in said if what == "flow: matching"] == [0, FIRST_TENTH_SHARE][
        :tenths
    ]
    assert max(shares) <= (FIRST_TENTH_SHARE, 1)[tenths - 1]


@pytest.mark.usefixtures("whole_fits")
def test_no_step_of_a_fit_is_half_of_it() -> None:
    parts: tuple[Component, ...] = ("flow", "kernels", "mixture")
    rng, shares = np.random.default_rng(0), [0.0]
    points = SPACE.project(torch.tensor(0.1 * rng.normal(size=(120, 2))))
    settings = od.DensitySettings(components=parts, **QUICK)
    od.fit_automatic(SPACE, points, settings, progress=lambda done, _: shares.append(done))
    assert shares == sorted(shares)
    assert shares[-1] == BEFORE_END
    assert max(np.diff(shares)) < 0.35


@pytest.mark.parametrize(("tenths", "weighted"), [(1, False), (2, True)])
def test_a_flow_is_compared_at_the_rows_that_it_was_tried_on(
    tenths: int, weighted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # sure at once, or never: then a second tenth is asked
    monkeypatch.setattr(Gain, "is_sure", property(lambda _: tenths == 1))
    monkeypatch.setattr("orbiflow.density.fitting.flow_trial._is_worth_it", lambda _: True)
    own = np.random.default_rng(1).uniform(0.5, 2.0, 700) if weighted else None
    folds, candidates, weights = evidence(own)
    (flow,) = tried(folds, candidates, weights).evidence
    assert flow.rows == 70 * tenths
    above = (stacked(candidates.table, weights) - candidates.table[-1])[: flow.rows]
    row_weights = None if own is None else candidates.row_weights
    expected = np.average(above, weights=None if row_weights is None else row_weights[: flow.rows])
    assert flow.others == pytest.approx(expected, abs=1e-12)
    assert flow.alone < expected + 0.1
    assert ComponentEvidence(**asdict(flow)) == flow
    (kernels,) = judged(candidates, weights)
    assert kernels.others is None
    assert kernels.rows == 140


@pytest.mark.parametrize(
    ("above", "hope", "given_up"), [(0.5, 0.4, True), (0.5, 0.6, False), (-0.5, 0.0, False)]
)
def test_a_flow_is_outdone_that_gains_nothing_and_cannot_catch_up(
    above: float, hope: float, given_up: bool
) -> None:
    folds, _, _ = evidence()
    held = folds.held(0)
    even = torch.zeros(len(held), dtype=torch.float64)
    flow = od.FlowDensity(
        SPACE, Flow([SplineField(SPACE.group, 1)], steps=1)
    )  # which moves nothing
    assert outdone_by(even + above, even, held)(flow, hope) is given_up


def test_an_outdone_flow_is_refined_no_further() -> None:
    points = SPACE.project(0.1 * torch.randn(50, 2, generator=torch.Generator().manual_seed(0)))
    small = {"max_frequency": 1, "segments": 1, "iterations": 8, "roughness": (1e-3, 1e-4)}
    settings = od.FlowSettings(**small)  # type: ignore[arg-type]

    def fitted(outdone) -> list[tuple[str, int]]:
        stages = od.fit_density(SPACE, points.double(), settings, outdone=outdone)[1].stages
        return [(stage.stopped, len(stage.validation)) for stage in stages]

    for times in (1, 2):  # after a quarter of the first stage, and halfway
        hopes: list[float] = []
        given_up = fitted(lambda _, hope, own=hopes, n=times: own.append(hope) or len(own) == n)
        assert given_up == [("outdone", 1 + times)]
    whole = fitted(None)
    assert fitted(lambda _, hope: hope == 0) == whole[:1]
    assert fitted(lambda *_: False) == whole
