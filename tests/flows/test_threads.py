"""Small clouds are carried on one thread, whatever the user's number is."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
import torch
from torch import Tensor

from orbiflow.flows import Flow
from orbiflow.flows.flow import MULTITHREADED_COORDINATES


@pytest.fixture
def seen() -> Iterator[list[int]]:
    before = torch.get_num_threads()
    torch.set_num_threads(3)
    yield []
    assert torch.get_num_threads() == 3
    torch.set_num_threads(before)


@pytest.mark.parametrize(("count", "threads"), [(5, 1), (MULTITHREADED_COORDINATES, 3)])
@pytest.mark.parametrize("apply", ["forward", "inverse", "forward_and_log_det"])
def test_how_many_threads_carry(seen: list[int], count: int, threads: int, apply: str) -> None:
    def field(points: Tensor) -> Tensor:
        seen.append(torch.get_num_threads())
        return 0 * points

    flow = Flow(field, steps=1, method="euler", warn=False)
    getattr(flow, apply)(torch.zeros(count, 1))
    assert set(seen) == {threads}
