"""What the studio remembers, and its queue of tasks."""

import asyncio
import json
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageDraw

from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import Failed, Finished, ItemDone, Note, Progress
from orbiflow.studio import Store, WorkQueue
from orbiflow.studio.hub import Hub
from orbiflow.studio.silhouette_file import load_target, read_input, silhouette_file
from orbiflow.studio.store import Missing
from orbiflow.studio.words import shown_project
from orbiflow.tiles import ReadingSettings, Target
from orbiflow.tiles.silhouette import left_out_share
from studio.served import Bench, ByHand, InThread, join_tasks


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.queue.close()
    made.store.close()


def test_projects_take_turns(bench: Bench) -> None:
    eager, late = bench.project(), bench.project()
    first = [bench.search(eager) for _ in range(3)]
    other = bench.search(late)
    for _ in range(4):
        bench.made[-1].finish()
    assert bench.begun == [first[0], other, first[1], first[2]]
    assert bench.states(*first, other) == ["done"] * 4


def test_what_somebody_waits_for_waits_for_no_search(bench: Bench) -> None:
    project = bench.project()
    long = [bench.search(project) for _ in range(2)]
    quick = bench.queue.submit(project, "read", {})
    assert bench.begun == [long[0], quick]
    assert bench.states(*long, quick) == ["running", "waiting", "running"]


def test_the_newest_reading_is_the_last_to_end(bench: Bench) -> None:
    bench.queue.slots["quick"] = 2
    project, other = bench.project(), bench.project()
    tasks = [bench.queue.submit(project, "read", {}) for _ in range(2)]
    assert bench.states(*tasks) == ["running", "waiting"]  # not side by side
    bench.queue.forget(project, "read", state="waiting")
    tasks.append(bench.queue.submit(project, "read", {}))
    beside = bench.queue.submit(other, "read", {})
    assert bench.states(*tasks, beside) == ["running", "cancelled", "waiting", "running"]
    bench.made[0].finish()
    assert bench.states(*tasks) == ["done", "cancelled", "running"]
    # and the process that has ended one reading does the next
    assert len(bench.made) == 2
    bench.made[0].finish()
    bench.made[1].finish()


def test_what_uses_a_reading_waits_for_it(bench: Bench) -> None:
    bench.queue.slots.update(long=2, quick=2)
    project, other = bench.project(), bench.project()
    table = bench.queue.submit(project, "density table", {})
    angles = {"space": "torus", "columns": ["phi", "psi"]}
    fit = bench.queue.submit(project, "density fit", angles)
    search = bench.search(other)
    assert bench.states(table, fit, search) == ["running", "waiting", "running"]
    bench.made[0].finish()
    assert bench.states(table, fit) == ["done", "running"]
    for process in bench.made:
        if process.alive:
            process.finish()


def test_old_tasks_that_are_not_done_are_listed(bench: Bench) -> None:
    project = bench.project()
    search = bench.search(project)
    for _ in range(120):
        bench.store.change_task(bench.store.add_task(project, "read", {}, "quick", 9), state="done")
    listed = [task["id"] for task in bench.store.tasks(project)]
    assert (len(listed), listed[-1]) == (101, search)


def test_a_task_that_is_held_lets_others_go_on(bench: Bench) -> None:
    project = bench.project()
    first, second = bench.search(project), bench.search(project)
    bench.queue.pause(first)
    assert bench.states(first, second) == ["paused", "running"]
    bench.queue.resume(first)
    assert bench.states(first, second) == ["waiting", "running"]
    bench.made[1].finish()
    assert bench.states(first, second) == ["running", "done"]
    assert bench.made[0].log == ["begin", "pause", "resume"]
    bench.made[0].finish()
    assert bench.states(first) == ["done"]


def test_only_a_few_processes_are_kept_in_memory(bench: Bench) -> None:
    project = bench.project()
    tasks = [bench.search(project) for _ in range(5)]
    for task in tasks:
        bench.queue.pause(task)
    assert bench.states(*tasks) == ["paused"] * 5
    assert [process.log[-1] for process in bench.made] == [*["kill"] * 2, *["pause"] * 3]
    bench.queue.resume(tasks[0])  # begins anew, with the tiles that it has
    assert bench.begun == [*tasks, tasks[0]]


def test_tasks_begin_with_processes_that_are_ready(tmp_path: Path) -> None:
    store, made, ready = Store(tmp_path), list[ByHand](), threading.Semaphore(0)

    def spawn() -> Any:
        ready.acquire()  # a process that takes its time to start
        made.append(ByHand(len(made)))
        if len(made) > 2:  # a spare: what has not begun waits to be ended
            made[-1].begin(made[0].call)  # pyright: ignore[reportArgumentType]
        return made[-1]

    queue = WorkQueue(store, slots={"long": 3, "quick": 1}, spares=1, spawn=spawn)
    queue.start()
    project = store.create("tile", "a project", 9)
    tasks = [queue.submit(project, "search", {}) for _ in range(2)]
    states = [store.task(task)["state"] for task in tasks]
    assert states == ["waiting", "waiting"]  # and who submitted did not wait
    for _ in range(3):
        ready.release()
    while len(made) < 3 or len(queue._running) < 2:  # pyright: ignore[reportPrivateUsage]
        pass
    assert [process.task for process in made[:2]] == tasks
    ready.release()
    queue.close()
    join_tasks()
    join_tasks("processes")
    store.close()


def test_a_quick_task_borrows_a_process(tmp_path: Path) -> None:
    store, made = Store(tmp_path), list[InThread]()

    def spawn() -> Any:
        made.append(InThread())
        return made[-1]

    queue = WorkQueue(store, slots={"long": 1, "quick": 1}, spares=2, spawn=spawn)
    queue.start()
    while len(queue._spares) < 2:  # pyright: ignore[reportPrivateUsage]
        pass
    task = queue.submit(store.create("tile", "a project", 9), "read", {})
    join_tasks(f"task {task}")
    assert "no picture" in store.task(task)["error"]
    assert made[0] in queue._spares  # pyright: ignore[reportPrivateUsage]
    queue.close()
    join_tasks("processes")
    assert len(made) == 2
    store.close()


def test_cancelling(bench: Bench) -> None:
    project = bench.project()
    running, waiting = bench.search(project), bench.search(project)
    bench.queue.cancel(waiting)
    bench.queue.cancel(running)
    bench.queue.cancel(running)
    join_tasks()
    assert bench.states(running, waiting) == ["cancelled"] * 2
    assert bench.made[0].log == ["begin", "kill"]
    bench.queue.resume(running)
    assert bench.states(running) == ["cancelled"]


def test_what_goes_on_while_it_is_cancelled_ends(bench: Bench, monkeypatch) -> None:
    task = bench.search(bench.project())
    bench.queue.pause(task)
    asked, cancelling = bench.store.task, threading.Thread(target=bench.queue.cancel, args=[task])

    def ask(number: int) -> dict[str, Any]:
        found = asked(number)
        if threading.current_thread() is not cancelling and not cancelling.ident:
            cancelling.start()
            cancelling.join(0.2)  # it comes between a look and what is done about it, if it can
        return found

    monkeypatch.setattr(bench.store, "task", ask)
    bench.queue.resume(task)
    cancelling.join()
    assert bench.states(task) == ["cancelled"]
    assert len(bench.made) == 1


def test_faults_are_told_without_insides_and_mistakes_without_paths(bench: Bench) -> None:
    project = bench.project()
    for ending in (Failed("ValueError: x = /home/me", "error"), Failed("no memory", "died")):
        task = bench.search(project)
        bench.made[-1].say(ending)
        bench.made[-1].say(None)
        join_tasks()
        assert bench.states(task) == ["failed"]
        assert "ValueError" not in bench.store.task(task)["error"]
    task = bench.search(project)
    home = bench.store.home(project)
    bench.made[-1].say(Note(f"took {home}/input.png", warning=True))
    bench.made[-1].say(Failed(f"{home}/input.png: no shape in it", "mistake"))
    bench.made[-1].say(None)
    join_tasks()
    assert bench.store.task(task)["error"] == "input.png: no shape in it"
    (notice,) = (e for e in bench.store.events(project, 0) if e["kind"] == "notice")
    assert notice["data"] == {"text": "took input.png", "warning": True}


def test_a_tile_is_on_its_card_before_the_search_ends(bench: Bench) -> None:
    project = bench.project()
    task = bench.search(project)
    for stage, score in (("sketch", 0.25), ("final", 0.5)):
        folder = bench.store.home(project) / "tiles" / f"{task}000" / stage
        folder.mkdir(parents=True)
        (folder / "card.json").write_text(json.dumps({"id": task * 1000, "score": score}))
        bench.made[0].say(ItemDone(f"{task}000/{stage}", "done", "tile"))
    bench.made[0].finish()
    assert [card["score"] for card in bench.store.cards(project)] == [0.5]
    kinds = [event["kind"] for event in bench.store.events(project, 0)]
    assert kinds.count("card") == 1  # the later one replaces it


def test_a_project_that_is_deleted_takes_its_tasks_along(bench: Bench) -> None:
    project = bench.project()
    bench.search(project)
    bench.queue.forget(project)
    bench.store.delete(project)
    bench.made[0].say(Progress(0.5, "late"))
    bench.made[0].finish() if bench.made[0].alive else None
    assert bench.store.undone() == []
    assert not bench.store.home(project).exists()
    with pytest.raises(Missing, match="go back"):
        bench.store.project(project)


def test_the_next_server_goes_on(tmp_path: Path) -> None:
    one = Bench(tmp_path / "data")
    project = one.project()
    tasks = [one.search(project) for _ in range(3)]
    one.queue.pause(tasks[2])
    one.queue.close()
    join_tasks()
    one.store.close()
    other = Bench(tmp_path / "data")
    assert other.states(*tasks) == ["running", "waiting", "paused"]
    other.queue.start()
    assert other.begun == [tasks[0]]
    other.made[0].finish()
    other.made[1].finish()
    assert other.states(*tasks) == ["done", "done", "paused"]
    other.queue.close()
    other.store.close()


def told(hub: Hub, project: str, after: int, count: int) -> list[tuple[int, str, Any]]:
    """Return so many events of a stream."""

    async def read() -> list[tuple[int, str, Any]]:
        found: list[tuple[int, str, Any]] = []
        stream = hub.stream(project, after)
        async for message in stream:
            lines = dict(line.split(": ", 1) for line in message.decode().split("\n") if line)
            if "event" in lines:
                found.append((int(lines["id"]), lines["event"], json.loads(lines["data"])))
            if len(found) == count:
                break
        await stream.aclose()  # pyright: ignore[reportAttributeAccessIssue]
        return found

    return asyncio.run(read())


def test_a_stream_is_resumed(bench: Bench) -> None:
    project, hub = bench.project(), Hub(bench.store)
    task = bench.search(project)
    head = shown_project(bench.store, bench.store.project(project))["head"]
    bench.store.notice(project, "one", warning=False)
    bench.store.change(project, name="two")
    ((first, kind, data), (second, *_)) = told(hub, project, head, 2)
    assert (kind, data["text"]) == ("notice", "one")
    assert [event[:2] for event in told(hub, project, first, 1)] == [(second, "project")]
    # from the very start: everything that is true now, once
    kinds = [(event[1], event[2].get("id")) for event in told(hub, project, 0, 3)]
    assert sorted(kinds, key=str) == [("notice", None), ("project", None), ("task", task)]
    # and it ends with its project
    bench.store.delete(project)
    assert [event[1:] for event in told(hub, project, 0, 1)] == [("gone", {"project": project})]


def test_a_change_wakes_the_streams_of_its_project(bench: Bench) -> None:
    project, other = bench.project(), bench.project()

    async def watch() -> list[bool]:
        hub = Hub(bench.store)
        hub.open(asyncio.get_running_loop())
        changes = hub.changes(project)
        first = await anext(changes)
        later = asyncio.create_task(anext(changes))  # pyright: ignore[reportArgumentType]
        bench.store.change(other, name="not this one")
        bench.store.change(project, name="this one")
        seen = [first, await later]
        hub.close()
        return seen

    assert asyncio.run(watch()) == [True, True]


def test_the_log_goes_into_the_file_and_litter_goes(tmp_path: Path) -> None:
    store = Store(tmp_path)
    project = store.create("tile", "a project", 9)
    file, log = tmp_path / "studio.sqlite3", tmp_path / "studio.sqlite3-wal"
    before = file.stat().st_size
    for k in range(200):
        store.change(project, view={"text": "x" * 1000, "turn": k})
    grown = log.stat().st_size
    store.settle()
    assert file.stat().st_size >= before
    for k in range(200):
        store.change(project, view={"text": "y" * 1000, "turn": k})
    assert log.stat().st_size < 1.5 * grown  # the log is used anew
    (store.home(project) / ".input.png.1234.tmp").touch()
    store.close()
    store = Store(tmp_path)
    assert store.project(project)["view"]["turn"] == 199
    assert not list(store.home(project).iterdir())
    store.close()


def test_a_folder_of_the_version_before_is_taken_over_and_a_later_one_not(tmp_path: Path) -> None:
    store = Store(tmp_path)
    project = store.create("tile", "a project", 9)
    for change in ("ALTER TABLE projects DROP COLUMN second", "PRAGMA user_version = 1"):
        store._data.execute(change)  # pyright: ignore[reportPrivateUsage]
    store.close()
    store = Store(tmp_path)
    assert (store.project(project)["name"], store.project(project)["second"]) == ("a project", None)
    with pytest.raises(OrbiflowError, match="no second picture"):
        store.change(project, "silhouette", 1, silhouette={})
    store.change(project, "silhouette", 1, input={"name": "a.png"})
    store.change(project, "silhouette", 1, silhouette={})
    assert store.project(project)["second"] == {"input": {"name": "a.png"}, "silhouette": {}}
    store._data.execute("PRAGMA user_version = 99")  # pyright: ignore[reportPrivateUsage]
    store.close()
    with pytest.raises(OrbiflowError, match="another version"):
        Store(tmp_path)


NAMES = ["submit", "pause", "resume", "cancel", "finish"]
ACTIONS = st.lists(st.tuples(st.sampled_from(NAMES), st.integers(0, 5)), max_size=30)


@settings(max_examples=15, deadline=None)
@given(ACTIONS)
def test_whatever_happens_slots_are_kept_and_all_tasks_end(
    tmp_path_factory: pytest.TempPathFactory, actions: list[tuple[str, int]]
) -> None:
    bench = Bench(tmp_path_factory.mktemp("data"), long=2)
    project, tasks = bench.project(), list[int]()
    steer = {"pause": bench.queue.pause, "resume": bench.queue.resume, "cancel": bench.queue.cancel}
    for action, which in actions:
        if action == "submit":
            tasks.append(bench.queue.submit(project, "search", {}, most=99))
        elif action == "finish":
            running = [p for p in bench.made if bench.states(p.task) == ["running"]]
            if running and "kill" not in running[-1].log:
                running[-1].say(Finished("done", {}))
                running[-1].say(None)
                join_tasks(f"task {running[-1].task}")
        elif tasks:
            steer[action](tasks[which % len(tasks)])
        states = bench.states(*tasks)
        assert states.count("running") <= 2
        assert "waiting" not in states or states.count("running") == 2
    for task in tasks:
        bench.queue.cancel(task)
    join_tasks()
    assert set(bench.states(*tasks)) <= {"done", "cancelled"}
    bench.queue.close()
    bench.store.close()


def test_the_studio_remembers_what_was_seen(tmp_path: Path) -> None:
    parts = '<path d="M10 60 60 60 60 90 10 90Z M10 20 60 20 60 40 10 40Z"/>'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">{parts}</svg>'
    (tmp_path / "input.svg").write_text(svg)
    ring = shapely.Polygon(Target.read(tmp_path / "input.svg").outline)
    read_input(tmp_path, "a.svg", ReadingSettings())
    again = load_target(tmp_path)
    assert np.isclose(shapely.Polygon(again.outline).area, ring.area)
    assert left_out_share(again) == pytest.approx(0.4, abs=1e-3)
    # what was read is kept until the picture, or how it is read, is another
    other = silhouette_file(tmp_path)
    other.write_text(other.read_text().replace("a.svg", "b.svg"))
    assert read_input(tmp_path, "b.svg", ReadingSettings()).source == "b.svg"
    with pytest.raises(InputFileError):
        read_input(tmp_path, "b.svg", ReadingSettings(invert=True))


@pytest.mark.parametrize(("ink", "is_told"), [((16, 16, 16), False), ((60, 140, 90), True)])
def test_the_studio_begins_without_the_picture_of_a_black_icon(
    tmp_path: Path, ink: tuple[int, int, int], is_told: bool
) -> None:
    image = Image.new("RGB", (300, 220), "white")
    pen = ImageDraw.Draw(image)
    pen.ellipse((40, 30, 260, 190), fill=ink)
    pen.ellipse((90, 60, 112, 82), fill="white")
    image.save(tmp_path / "input.png")
    read_input(tmp_path, "icon.png", ReadingSettings())
    shown = json.loads(silhouette_file(tmp_path).read_text())["shown"]
    assert shown["told_apart"] == is_told
    assert shown["coloured"]
