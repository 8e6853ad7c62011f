"""A search in the studio: tiles appear stage by stage, and a search that was killed goes on."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from threadpoolctl import threadpool_info, threadpool_limits

from bent_tiles import bent_tile
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, Event, ItemDone, Outcome, Progress, ignore
from orbiflow.studio import tasks
from orbiflow.studio.settings import Job, SearchChoice
from orbiflow.studio.tasks import read, search
from orbiflow.studio.tile_files import best_stage, put_tile, tile_folder
from orbiflow.tiles import EscherTile, OverlapSearch, read_result
from orbiflow.tiles.search import escherizing

BOOT = b"[[0, 0], [30, 0], [34, 12], [22, 15], [20, 28], [8, 25]]"
CHOICE = SearchChoice(effort="fast", classes=("IH4", "IH7"))
TILES = (5000, 5050)  # of task 5

Seen = list[tuple[int, str]]


@pytest.fixture(autouse=True)
def one_core(small_searches: None, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: ARG001
    monkeypatch.setattr(tasks, "cores", lambda: 1)


@pytest.fixture
def home(tmp_path: Path) -> Path:
    (tmp_path / "input.json").write_bytes(BOOT)
    read(Job(project=tmp_path, task=1), "boot.json")
    return tmp_path


def run(home: Path, stop: Callable[[Seen], bool] = lambda _: False) -> tuple[Outcome, Seen]:
    """Search until it is to stop; return what came of it and the stages of tiles in order."""
    seen, cancel = Seen(), Cancel()
    shares = [0.0]

    def watch(event: Event) -> None:
        if isinstance(event, ItemDone):
            number, stage = event.name.split("/")
            seen.append((int(number), stage))
            folder = home / "tiles" / number / stage
            # whole when it is told of
            assert {file.name for file in folder.iterdir()} >= {"card.json", "view.json", "tile"}
        if isinstance(event, Progress):
            assert event.share >= shares[-1]
            shares.append(event.share)
        if stop(seen):
            cancel.cancel()

    job = Job(project=home, task=5)
    return search(job, CHOICE, on_event=watch, cancel=cancel), seen


def test_tiles_appear_stage_by_stage(home: Path) -> None:
    outcome, seen = run(home)
    assert outcome.state == "done"
    assert seen[:2] == [(5000, "sketch"), (5050, "sketch")]
    assert [stage for _, stage in seen[-2:]] == ["final", "final"]
    for number in TILES:
        tile = read_result(tile_folder(home, number))
        assert tile.certificate.valid
        assert tile.bending is not None
    assert not list((home / "tiles").glob(".*"))


def test_the_first_tile_waits_for_nothing_twice(home: Path, monkeypatch) -> None:
    asked, threads = list[object](), set[int]()
    near, put = escherizing.near_symmetry, tasks.put_tile

    def put_with_threads(*given: Any) -> None:
        pools = [pool for pool in threadpool_info() if pool["user_api"] == "blas"]
        threads.update(pool["num_threads"] for pool in pools)
        put(*given)

    monkeypatch.setattr(escherizing, "near_symmetry", lambda own: asked.append(own) or near(own))
    monkeypatch.setattr(tasks, "put_tile", put_with_threads)
    with threadpool_limits(2, user_api="blas"):
        run(home, lambda seen: len(seen) == 1)
    assert len(asked) == 1
    assert threads == {1}  # more would wait for the processes that search


def test_a_search_that_was_stopped_goes_on(home: Path) -> None:
    outcome, first = run(home, lambda seen: (5000, "final") in seen)
    assert outcome.state == "cancelled"
    assert (5050, "final") not in first
    before = (best_stage(home, 5000) or home).stat().st_mtime_ns
    outcome, then = run(home)
    assert outcome.state == "done"
    assert then[0] == (5000, "final")  # told again, and not searched again
    assert [number for number, stage in then if stage == "final"] == list(TILES)
    assert (best_stage(home, 5000) or home).stat().st_mtime_ns == before
    outcome, last = run(home)
    assert last == [(5000, "final"), (5050, "final")]


def test_what_is_painted_goes_into_the_search(home: Path) -> None:
    def settings(**choice: Any) -> dict[str, Any]:
        own = tasks._search_settings(home, SearchChoice(**choice))  # pyright: ignore[reportPrivateUsage]
        return own.to_json()

    assert not {"emphasis", "pin"} & set(settings())
    for name in ("emphasis", "pins"):
        Image.new("L", (10, 10), 255).save(home / f"{name}.png")
    assert settings()["emphasis"] == str(home / "emphasis.png")
    assert settings()["pin"] == [str(home / "pins.png")]
    overlap = settings(objective="overlap")
    assert "pin" not in overlap
    assert OverlapSearch.objective == overlap["objective"]


def test_more_like_one_tile_looks_longer_at_its_kin(home: Path) -> None:
    put_tile(home, 5000, "final", EscherTile(bent_tile("IH4")), ignore)
    own = tasks._search_settings(home, SearchChoice(effort="fast", like=5000))  # pyright: ignore
    assert own.classes is not None
    assert own.classes[0] == "IH4"
    assert "IH7" not in own.classes  # of another group
    assert (own.effort, own.per_class, own.seed) == ("normal", 4, 1)
    with pytest.raises(OrbiflowError, match="no such tile"):
        tasks._search_settings(home, SearchChoice(like=77))  # pyright: ignore
