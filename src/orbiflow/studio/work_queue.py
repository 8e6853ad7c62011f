"""The queue of tasks: each runs in a worker process, projects take turns, and nothing is lost.

A task's state is in the store before and after everything, and workers write their results whole. So a
server that dies finds its tasks again when it starts, and those that ran go on from what they had.
"""

from __future__ import annotations

import json
import logging
import os
import re
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import (
    Call,
    CallProcess,
    Event,
    Failed,
    Finished,
    ItemDone,
    Note,
    Progress,
    cores,
)
from orbiflow.studio.kinds_of_work import READS, kind_of_work
from orbiflow.studio.store import Missing, Store
from orbiflow.studio.words import OF_PICTURE, own_names, page_words, plain_name, what_task

READINGS = frozenset({*READS, "density table", "mesh read"})
"""Tasks whose results the later ones of their project use."""

WARM_MODULES = (
    "orbiflow.studio.tasks",
    "orbiflow.studio.taking",
    "orbiflow.tiles.make.art",
    "orbiflow.tiles.write.png",
    "orbiflow.studio.pulled_tiles",
    "orbiflow.studio.silhouette_file",
    "orbiflow.studio.tile_view",
    "orbiflow.tiles.search.escherizing",
    "orbiflow.tiles.search.bending",
)
"""What a worker has imported before there is work for it."""

MIN_PROGRESS_STEP = 0.002  # of a task: smaller progress is not reported
MAX_CALLS = 40  # of a process, one after another
MAX_HELD = 3  # processes that are kept in memory while their tasks are paused
OF_FILES = ("written ", "laid the ")  # how notes begin that are about files of the studio's own
FAULT_TEXT = (
    "something went wrong inside orbiflow; the server's own output says what. Try other settings."
)

OWN_FILE = re.compile(r"^(backdrop|drawing)(-2)?\.[a-z]+: ")
"""How errors begin that are about a picture of the studio's own, by a name that nobody gave it."""

log = logging.getLogger("orbiflow.studio")
Spawn = Callable[[], CallProcess]


def warm_process() -> CallProcess:
    """Return a process that gets ready and waits for calls."""
    return CallProcess(modules=WARM_MODULES, again=True)


class WorkQueue:
    """Tasks in worker processes; any thread may use it.

    Args:
        store: Where tasks are kept.
        slots: The number of tasks of each lane that run at a time.
        spares: The number of processes that are started ahead; with 0, each when it is needed.
        spawn: A function that starts one.
    """

    def __init__(
        self,
        store: Store,
        *,
        slots: dict[str, int] | None = None,
        spares: int = 2,
        spawn: Spawn = warm_process,
    ) -> None:
        self.store = store
        self.slots = slots or {"long": cores(), "quick": max(2, cores() // 2)}
        self._spare_count, self._spawn = spares, spawn
        self._spares: list[CallProcess] = []
        self._calls: Counter[CallProcess] = Counter()  # that each has done
        self._running: dict[int, CallProcess] = {}
        self._held: dict[int, CallProcess] = {}  # in the order in which they were paused
        # project, lane and operation of what runs
        self._lanes: dict[int, tuple[str, str, str]] = {}
        self._begun: dict[int, float] = {}  # when tasks began that were never held, in seconds
        self._turns: dict[str, int] = {}  # when each project was served last
        self._turn = 0
        self._lock = threading.RLock()
        self._closed = False
        self._wanted = threading.Event()  # a look at whether more processes should be ready

    def start(self) -> None:
        """Begin, with the tasks that were not done when the last server ended."""
        for task in self.store.undone():
            if task["pid"] and os.name == "posix":
                with suppress(OSError):  # held when its server died: it then sees that, and ends
                    os.killpg(task["pid"], signal.SIGCONT)
            if task["state"] == "running":
                self.store.change_task(task["id"], state="waiting", pid=None)
        threading.Thread(target=self._keep_ready, daemon=True, name="processes").start()
        self._schedule()

    def close(self) -> None:
        """End all processes; their tasks go on when the next server starts."""
        with self._lock:
            self._closed = True
            alive = [*self._running.values(), *self._held.values(), *self._spares]
            self._spares.clear()
        self._wanted.set()
        for process in alive:
            process.kill()
            process.wait()

    def submit(
        self, project: str, operation: str, settings: dict[str, Any], *, most: int = 20
    ) -> int:
        """Put a task at the end of the queue and return its number.

        Raises `OrbiflowError` for settings that cannot be used, or too many tasks.
        """
        kind = kind_of_work(operation)
        kind.call(self.store.home(project), 1, settings)
        task = self.store.add_task(project, operation, settings, kind.lane, most)
        self._schedule()
        return task

    def pause(self, task: int) -> None:
        """Hold a task; its process waits in memory, where there is room for it."""
        with self._lock:
            process = self._running.get(task)
            if process is None:
                if self.store.task(task)["state"] == "waiting":
                    self.store.change_task(task, state="paused")
                return
            self.store.change_task(task, state="paused")
            self._begun.pop(task, None)
            if process.pause():
                self._held[task] = self._running.pop(task)
                for oldest in list(self._held)[:-MAX_HELD]:
                    self._held.pop(oldest).kill()
            else:
                self._running.pop(task).kill()
            self._lanes.pop(task, None)
        self._schedule()

    def resume(self, task: int) -> None:
        """Let a task that was held go on when its turn comes."""
        with self._lock:  # or a task that is cancelled meanwhile would wait again
            if self.store.task(task)["state"] == "paused":
                self.store.change_task(task, state="waiting")
        self._schedule()

    def cancel(self, task: int) -> None:
        """End a task; what it has found is kept."""
        with self._lock:
            if self.store.task(task)["state"] not in ("waiting", "running", "paused"):
                return
            self.store.change_task(task, state="cancelled", pid=None)
            process = self._running.pop(task, None) or self._held.pop(task, None)
            self._lanes.pop(task, None)
        if process is not None:
            process.kill()
        self._schedule()

    def forget(self, project: str, *operations: str, state: str = "") -> None:
        """End the tasks of a project: of some kinds, or all; those in a state, or in any."""
        for task in self.store.undone(project):
            if (not operations or task["operation"] in operations) and state in ("", task["state"]):
                self.cancel(task["id"])

    def _schedule(self) -> None:
        """Start what can be started. Nobody waits here for a process to start."""
        with self._lock:
            while not self._closed and (task := self._next()) is not None and self._begin(task):
                pass
            for process in self._spares[self._spare_count :]:
                process.kill()
            del self._spares[self._spare_count :]
        self._wanted.set()

    def _keep_ready(self) -> None:
        """Start processes ahead, in a thread of its own, until the queue is closed."""
        while not self._closed:
            self._wanted.wait()
            self._wanted.clear()
            while self._is_short():
                try:
                    process = self._spawn()
                except OSError:  # no memory, or too many processes: again when something ends
                    log.exception("no process can be started")
                    break
                with self._lock:
                    self._spares.append(process)
                    if self._closed:
                        process.kill()
                self._schedule()

    def _is_short(self) -> bool:
        """Whether more processes should be ready; all but one may be lent to quick tasks."""
        with self._lock:
            lent = sum(lane == "quick" for _, lane, _ in self._lanes.values())
            ready = len(self._spares) + min(lent, max(0, self._spare_count - 1))
            return not self._closed and ready < self._spare_count

    def _ready(self) -> CallProcess | None:
        """Return a process that waits for a call, if there is one."""
        self._spares = [spare for spare in self._spares if spare.alive]
        if self._spares:
            return self._spares.pop(0)
        return None if self._spare_count else self._spawn()

    def _next(self) -> dict[str, Any] | None:
        """Return the task whose turn it is: of the project that has least, then waited longest."""
        running = [self._lanes[task] for task in self._running]
        full = Counter(lane for _, lane, _ in running)
        taken = Counter((project, lane) for project, lane, _ in running)
        waiting: list[dict[str, Any]] = []
        reading: set[str] = set()  # projects whose input an older task is yet to read
        for task in self.store.undone():
            free = task["state"] == "waiting" and task["id"] not in self._running
            if free and full[task["lane"]] < self.slots[task["lane"]]:
                waiting += [task] * (task["project"] not in reading)
            if task["operation"] in READINGS and task["state"] != "paused":
                reading.add(task["project"])

        def turn(task: dict[str, Any]) -> tuple[int, int, int]:
            project = task["project"]
            return taken[project, task["lane"]], self._turns.get(project, 0), task["id"]

        return min(waiting, key=turn, default=None)

    def _begin(self, task: dict[str, Any]) -> bool:
        """Start a task or let it go on; return False if it must wait for a process."""
        number, project = task["id"], task["project"]
        held = self._held.pop(number, None)
        if held is None:
            try:
                kind = kind_of_work(task["operation"])
                call = kind.call(self.store.home(project), number, task["settings"])
            except OrbiflowError as error:
                self.store.change_task(number, state="failed", error=str(error))
                return True
            if (process := self._ready()) is None:
                return False
            self._running[number], self._begun[number] = process, time.monotonic()
            self.store.change_task(number, state="running", pid=process.pid, share=0.0)
            follow = partial(self._follow, number, project, process, call)
            threading.Thread(target=follow, daemon=True, name=f"task {number}").start()
        else:
            self._running[number] = held
            self.store.change_task(number, state="running")
            held.resume()
        self._turn += 1
        self._turns[project] = self._turn
        self._lanes[number] = project, task["lane"], task["operation"]
        return True

    def _follow(self, number: int, project: str, process: CallProcess, call: Call) -> None:
        """Give a process its call and record its events, to its end."""
        process.begin(call)  # which waits until the process reads it
        recorder = _Recorder(self.store, project, number)
        ending: Event | None = None
        for event in process.events():
            if self._owner(number) is not process:
                continue  # cancelled, or held and then let go: the rest says nothing
            if isinstance(event, Finished | Failed):
                ending = event
            else:
                recorder.record(event)
        with self._lock:
            begun = self._begun.pop(number, None)
            if self._owner(number) is process and not self._closed:
                if begun is not None and isinstance(ending, Finished):
                    with suppress(Missing):
                        what = what_task(self.store, self.store.task(number))
                        self.store.took[what] = round(time.monotonic() - begun, 1)
                recorder.end(ending)
                self._let_go(number, process)
        self._schedule()

    def _let_go(self, number: int, process: CallProcess) -> None:
        """Keep the process of a task that has ended for another quick one, or end it."""
        _, lane, _ = self._lanes.pop(number)
        for processes in (self._running, self._held):
            processes.pop(number, None)
        self._calls[process] += 1
        if lane == "quick" and process.alive and self._calls[process] < MAX_CALLS:
            self._spares.insert(0, process)
        else:
            del self._calls[process]
            process.kill()

    def _owner(self, number: int) -> CallProcess | None:
        with self._lock:
            return self._running.get(number) or self._held.get(number)


class _Recorder:
    """Puts the events of a task's process into the store."""

    def __init__(self, store: Store, project: str, number: int) -> None:
        self.store, self.project, self.number = store, project, number
        self.home = store.home(project)
        self.share, self.what = -1.0, ""
        self.notes: list[str] = []

    def record(self, event: Event) -> None:
        """Keep an event, if anybody is to know of it."""
        with suppress(Missing, FileNotFoundError):  # a tile may have gone already
            match event:
                case Progress(share=share, what=what):
                    if share >= self.share + MIN_PROGRESS_STEP or what != self.what:
                        self.share, self.what = share, what
                        self.store.change_task(self.number, share=share, what=what)
                case ItemDone(name=name, state="done", what="tile"):
                    tile, stage = name.split("/")
                    card = json.loads(
                        (self.home / "tiles" / tile / stage / "card.json").read_text()
                    )
                    self.store.put_card(self.project, int(tile), card)
                case Note(text=text, warning=warning) if not text.startswith(OF_FILES):
                    if (plain := self._plain(text)) not in self.notes:
                        self.notes.append(plain)
                        self.store.change_task(self.number, result={"notes": self.notes})
                    if warning:
                        self.store.notice(self.project, plain, warning=warning)
                case _:
                    pass

    def end(self, ending: Event | None) -> None:
        """Keep how the task ended."""
        changes: dict[str, Any] = {"pid": None}
        if isinstance(ending, Finished):
            result = {**ending.summary, "notes": self.notes}
            state = "cancelled" if ending.state == "cancelled" else "done"
            changes |= {"state": state, "share": 1.0, "result": result}
            self._take_up(ending.summary)
        elif isinstance(ending, Failed) and ending.failure == "mistake":
            changes |= {"state": "failed", "error": self._plain(ending.message)}
        else:
            log.error("task %s: %s", self.number, ending)
            changes |= {"state": "failed", "error": FAULT_TEXT}
        self.store.change_task(self.number, **changes)

    def _take_up(self, summary: dict[str, Any]) -> None:
        """Keep what was read, what an opened file says of its project, and that tiles are gone."""
        with suppress(Missing):
            if opened := summary.get("opened"):
                opened["name"] = plain_name(opened["name"], "Opened project")
                self.store.change(self.project, **opened)
            for number in summary.get("read", ()):
                file = self.home / f"silhouette{OF_PICTURE[number]}.json"
                shown = json.loads(file.read_text())["shown"]
                self.store.change(self.project, "silhouette", number, silhouette=shown)
        for number in summary.get("gone", ()):
            with suppress(Missing):
                self.store.delete_tile(self.project, number)

    def _plain(self, text: str) -> str:
        """Return a text in the page's words, with the user's names of files, without paths."""
        text = page_words(text)
        for folder in (self.home, self.home.resolve(), self.store.folder, Path.home()):
            text = text.replace(f"{folder}{os.sep}", "")
        with suppress(Missing):
            text = own_names(text, self.store.project(self.project))
        return OWN_FILE.sub("", text)
