"""Whether a flow belongs beside other parts: what it is compared with, how far it is."""

from dataclasses import asdict
from typing import Any

import numpy as np
import pytest
import torch

from density.quick_fits import few_kernels
from orbiflow.density import DensitySettings, FlowSettings, Torus, fit_automatic, weighed
from orbiflow.density.fitting import COMPONENTS
from orbiflow.density.fitting.automatic import BEFORE_END
from orbiflow.density.fitting.evidence import (
    FIRST,
    Candidates,
    Course,
    TriedFlow,
    candidates_of,
    flow_beside,
    judged,
    stacked,
    supported_weights,
    try_flow,
)
from orbiflow.density.fitting.families import KernelFamily
from orbiflow.density.fitting.folds import Folds, folds_of
from orbiflow.density.fitting.likelihood import Budget
from orbiflow.density.fitting.report import ComponentEvidence
from orbiflow.density.fitting.rows import Gain
from orbiflow.density.fitting.settings import Component
from orbiflow.runtime import SideBySide, one_core

QUICK: dict[str, Any] = {
    "max_frequency": 2, "segments": 2, "iterations": 10, "roughness": (1e-3,)
}  # fmt: skip
SPACE = Torus(2)


def evidence(weights: np.ndarray | None = None) -> tuple[Folds, Candidates, torch.Tensor]:
    """Kernels of two broad clusters, judged by half of 700 rows."""
    rng = np.random.default_rng(0)
    points = torch.tensor(np.where(rng.random((700, 1)) < 0.7, [[0.3, 0.6]], [[0.8, 0.15]]))
    points = SPACE.project(points + 0.1 * torch.tensor(rng.normal(size=(700, 2))))
    folds = folds_of(
        weighed(points, weights), together=False, generator=torch.Generator().manual_seed(0)
    )
    with pytest.MonkeyPatch.context() as patch, one_core():
        few_kernels(patch)
        course = Course(lambda *_: None, 1.0)
        candidates = candidates_of(
            SPACE, [KernelFamily(SPACE)], folds, course, Budget(), SideBySide()
        )
    return (
        folds,
        candidates,
        supported_weights(candidates.table, candidates.floor, candidates.row_weights),
    )


def tried(
    folds: Folds, candidates: Candidates, weights: torch.Tensor, told=lambda *_: None
) -> TriedFlow:
    settings = FlowSettings(**QUICK)
    return try_flow(
        folds, candidates, weights, lambda k: flow_beside(SPACE, folds, k, settings, Budget(), told)
    )


@pytest.mark.parametrize("tenths", [1, 2])
def test_progress_goes_on_from_one_tenth_to_the_next(
    tenths: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Gain, "is_sure", property(lambda _: tenths == 1))
    monkeypatch.setattr("orbiflow.density.fitting.evidence._is_worth_it", lambda _: True)
    said: list[tuple[float, str]] = []
    tried(*evidence(), told=lambda done, what: said.append((done, what)))
    shares = [done for done, _ in said]
    assert shares == sorted(shares)
    assert [done for done, what in said if what == "flow: matching"] == [0, FIRST][:tenths]
    assert max(shares) <= (FIRST, 1)[tenths - 1]


@pytest.mark.parametrize("parts", [COMPONENTS, COMPONENTS[1:], ("kernels",)])
def test_no_step_of_a_fit_is_half_of_it(
    parts: tuple[Component, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    few_kernels(monkeypatch)
    rng, shares = np.random.default_rng(0), [0.0]
    points = SPACE.project(torch.tensor(0.1 * rng.normal(size=(700, 2))))
    settings = DensitySettings(components=parts, **(QUICK if "flow" in parts else {}))
    fit_automatic(SPACE, points, settings, progress=lambda done, _: shares.append(done))
    assert shares == sorted(shares)
    assert shares[-1] == BEFORE_END
    assert max(np.diff(shares)) < 0.35


def test_a_flow_that_has_no_time_is_none() -> None:
    folds, candidates, weights = evidence()
    spent = Budget(seconds=0)
    none = flow_beside(SPACE, folds, 0, FlowSettings(**QUICK), spent, lambda *_: None)
    assert none is None
    assert try_flow(folds, candidates, weights, lambda _: none) == TriedFlow()


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("tenths", [1, 2])
def test_a_flow_is_compared_at_the_rows_that_it_was_tried_on(
    tenths: int, weighted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    # sure at once, or never: then a second tenth is asked
    monkeypatch.setattr(Gain, "is_sure", property(lambda _: tenths == 1))
    monkeypatch.setattr("orbiflow.density.fitting.evidence._is_worth_it", lambda _: True)
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
    assert kernels.rows == 350


def test_it_is_said_of_which_rows_a_figure_is() -> None:
    flow = ComponentEvidence("flow", 0.0, 1.5264, 0.0, 0.0, 233, 1.529)
    assert str(flow) == (
        "flow: 0.0%, would add nothing; alone 1.5264 over uniform at 233 of these rows, where the "
        "others have 1.5290"
    )
    kernels = ComponentEvidence("kernels", 0.5, 1.5, 0.01, 0.002, 699)
    assert str(kernels) == "kernels: 50.0%, worth 0.0100 ± 0.0020 nats; alone 1.5000 over uniform"
