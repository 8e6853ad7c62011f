"""What the studio remembers: projects, tiles, tasks and what changed last, in one SQLite file.

Files of a project lie in its folder; a row says that they are complete. Every change leaves an event,
which replaces an earlier one about the same thing. So the list of events stays short, and whoever has
seen it up to some event needs only the later ones to know all.
"""

from __future__ import annotations

import json
import secrets
import shutil
import sqlite3
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import Any

from orbiflow.errors import OrbiflowError

VERSION = 2
TABLES = """
CREATE TABLE projects(id TEXT PRIMARY KEY, kind TEXT, name TEXT, created REAL, changed REAL,
    input TEXT, reading TEXT DEFAULT '{}', silhouette TEXT, view TEXT DEFAULT '{}', changed_by TEXT,
    second TEXT);
CREATE TABLE tiles(id INTEGER PRIMARY KEY, project TEXT, score REAL, card TEXT);
CREATE TABLE tasks(id INTEGER PRIMARY KEY AUTOINCREMENT, project TEXT, operation TEXT, settings TEXT,
    lane TEXT, state TEXT DEFAULT 'waiting', share REAL DEFAULT 0, what TEXT DEFAULT '',
    error TEXT, result TEXT, pid INTEGER);
CREATE TABLE events(id INTEGER PRIMARY KEY AUTOINCREMENT, project TEXT, kind TEXT, subject TEXT,
    data TEXT, UNIQUE(project, kind, subject));
CREATE INDEX tiles_of ON tiles(project);
CREATE INDEX tasks_of ON tasks(project);
CREATE INDEX tasks_in ON tasks(state);
CREATE INDEX events_of ON events(project, id);
"""
FROM_1 = "ALTER TABLE projects ADD COLUMN second TEXT;"
UNDONE = ("waiting", "running", "paused")
JSON = {"input", "reading", "silhouette", "view", "settings", "result", "card", "second"}
"""Columns that hold JSON; `second` has input, reading and silhouette of a second picture."""

SUMMARY = """
SELECT p.id, p.kind, p.name, p.changed, p.silhouette IS NOT NULL AS drawn,
    (SELECT count(DISTINCT coalesce(json_extract(t.card, '$.root'), t.id)) FROM tiles t
        WHERE t.project = p.id) AS tiles,
    EXISTS(SELECT 1 FROM tasks t WHERE t.project = p.id AND t.state IN ('waiting', 'running')) AS busy
FROM projects p ORDER BY p.changed DESC
"""


class Missing(OrbiflowError):
    """What was asked for is not there (any more)."""


class Store:
    """The studio's memory; any thread may use it.

    - `folder`: Where everything is kept.
    - `listeners`: Functions that are called with a project's id after it changed, in any thread.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.listeners: set[Callable[[str], object]] = set()
        self.took: dict[
            str, float
        ] = {}  # seconds of tasks since the server began, by what they were
        self._lock = threading.RLock()
        folder.mkdir(parents=True, exist_ok=True)
        self._data = sqlite3.connect(
            folder / "studio.sqlite3", check_same_thread=False, isolation_level=None
        )
        self._data.row_factory = sqlite3.Row
        # a request must not wait for the disk: see `settle`
        self._data.executescript(
            "PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL; PRAGMA wal_autocheckpoint=0;"
        )
        (version,) = self._data.execute("PRAGMA user_version").fetchone()
        if version in (0, 1):
            tables = FROM_1 if version else TABLES
            self._data.executescript(f"BEGIN; {tables} PRAGMA user_version={VERSION}; COMMIT;")
        elif version != VERSION:
            self._data.close()
            raise OrbiflowError(
                f"{folder} was written by another version of orbiflow; give another folder as data"
            )

        for litter in folder.glob("projects/*/.*.tmp"):  # uploads that a crash broke off
            litter.unlink(missing_ok=True)

    def close(self) -> None:
        """Close the file."""
        with self._lock:
            self._data.close()

    def settle(self) -> None:
        """Bring what was written from the log into the file, and the log to the disk.

        It may take seconds where the disk is busy; neither readers nor writers wait for it.
        """
        with closing(sqlite3.connect(self.folder / "studio.sqlite3")) as data:
            data.execute("PRAGMA wal_checkpoint(PASSIVE)")

    def home(self, project: str) -> Path:
        """Return the folder of a project's files."""
        return self.folder / "projects" / project

    @contextmanager
    def _changing(self, project: str) -> Iterator[sqlite3.Connection]:
        """Do several changes or none, and notify the listeners."""
        with self._lock:
            self._data.execute("BEGIN IMMEDIATE")
            try:
                yield self._data
            except BaseException:
                self._data.execute("ROLLBACK")
                raise
            self._data.execute("COMMIT")
        for listener in list(self.listeners):
            listener(project)

    def _rows(self, query: str, *values: Any) -> list[dict[str, Any]]:
        with self._lock, suppress(OverflowError):  # no number of anything is that large
            rows = self._data.execute(query, values).fetchall()
            return [_plain(row) for row in rows]
        return []

    def _row(self, query: str, *values: Any, what: str) -> dict[str, Any]:
        rows = self._rows(query, *values)
        if not rows:
            raise Missing(f"there is no such {what} (any more); go back to the list of projects")
        return rows[0]

    def _record(self, project: str, kind: str, subject: Any = "", data: Any = None) -> None:
        self._data.execute(
            "INSERT OR REPLACE INTO events(project, kind, subject, data) VALUES (?, ?, ?, ?)",
            (project, kind, str(subject), json.dumps(data)),
        )

    # projects

    def summaries(self) -> list[dict[str, Any]]:
        """Return a few words about each project, the last changed first."""
        return self._rows(SUMMARY)

    def create(self, kind: str, name: str, most: int) -> str:
        """Return the id of a new project. Raises `OrbiflowError` if there are `most` already."""
        project = secrets.token_urlsafe(9)
        with self._changing(project) as data:
            (count,) = data.execute("SELECT count(*) FROM projects").fetchone()
            if count >= most:
                raise OrbiflowError(
                    f"there are {count} projects already; delete some of them first"
                )
            now = time.time()
            data.execute(
                "INSERT INTO projects(id, kind, name, created, changed) VALUES (?, ?, ?, ?, ?)",
                (project, kind, name, now, now),
            )
            self.home(project).mkdir(parents=True)
        return project

    def project(self, project: str) -> dict[str, Any]:
        """Return what is known of a project, apart from its tiles and tasks."""
        return self._row("SELECT * FROM projects WHERE id = ?", project, what="project")

    def change(self, project: str, kind: str = "project", number: int = 0, **changes: Any) -> None:
        """Change columns of a project, or of its picture `number`, and record an event of this kind.

        There is a second picture when its `input` is set.
        """
        with self._changing(project):
            record = self.project(project)
            if number:
                if record["second"] is None and "input" not in changes:
                    raise Missing("there is no second picture (any more); add one first")
                changes = {"second": {**(record["second"] or {}), **changes}}
            self._update("projects", project, {**changes, "changed": time.time()})
            self._record(project, kind)

    def delete(self, project: str) -> None:
        """Forget a project, and remove its files."""
        with self._changing(project) as data:
            self.project(project)
            for table in ("tiles", "tasks", "events"):
                data.execute(f"DELETE FROM {table} WHERE project = ?", (project,))
            data.execute("DELETE FROM projects WHERE id = ?", (project,))
        shutil.rmtree(self.home(project), ignore_errors=True)

    def _update(self, table: str, key: Any, changes: dict[str, Any]) -> None:
        names = ", ".join(f"{name} = ?" for name in changes)
        values = [json.dumps(v) if n in JSON and v is not None else v for n, v in changes.items()]
        self._data.execute(f"UPDATE {table} SET {names} WHERE id = ?", (*values, key))

    # tiles

    def put_card(self, project: str, tile: int, card: dict[str, Any]) -> None:
        """Keep what a list of tiles shows of one."""
        with self._changing(project) as data:
            self.project(project)
            data.execute(
                "INSERT OR REPLACE INTO tiles(id, project, score, card) VALUES (?, ?, ?, ?)",
                (tile, project, card["score"], json.dumps(card)),
            )
            data.execute("UPDATE projects SET changed = ? WHERE id = ?", (time.time(), project))
            self._record(project, "card", tile)

    def cards(self, project: str) -> list[dict[str, Any]]:
        """Return the cards of a project's tiles, best first."""
        query = "SELECT card FROM tiles WHERE project = ? ORDER BY score DESC, id"
        return [row["card"] for row in self._rows(query, project)]

    def card(self, project: str, tile: int) -> dict[str, Any]:
        """Return the card of a tile."""
        query = "SELECT card FROM tiles WHERE project = ? AND id = ?"
        return self._row(query, project, tile, what="tile")["card"]

    def delete_tile(self, project: str, tile: int) -> None:
        """Forget a tile."""
        with self._changing(project) as data:
            self.card(project, tile)
            self._forget(data, project, "card", "tiles", tile)
            self._record(project, "gone", tile, {"tile": tile})

    # tasks

    def add_task(
        self, project: str, operation: str, settings: dict[str, Any], lane: str, most: int
    ) -> int:
        """Return the number of a new task.

        Raises `OrbiflowError` if the project has `most` that are not done.
        """
        with self._changing(project) as data:
            self.project(project)
            if len(self.undone(project)) >= most:
                raise OrbiflowError(
                    f"this project has {most} tasks that are not done; wait or cancel some of them"
                )
            made = data.execute(
                "INSERT INTO tasks(project, operation, settings, lane) VALUES (?, ?, ?, ?)",
                (project, operation, json.dumps(settings), lane),
            )
            assert made.lastrowid is not None
            self._record(project, "task", made.lastrowid)
            return made.lastrowid

    def task(self, task: int) -> dict[str, Any]:
        """Return all columns of a task."""
        return self._row("SELECT * FROM tasks WHERE id = ?", task, what="task")

    def tasks(self, project: str) -> list[dict[str, Any]]:
        """Return the last hundred tasks of a project, and all that are not done, newest first."""
        query = "SELECT * FROM tasks WHERE project = ? ORDER BY id DESC LIMIT 100"
        last = self._rows(query, project)
        older = [task for task in self.undone(project) if last and task["id"] < last[-1]["id"]]
        return [*last, *reversed(older)]

    def undone(self, project: str | None = None) -> list[dict[str, Any]]:
        """Return the tasks, of a project or all, that wait, run or are held, oldest first."""
        where, values = ("", ()) if project is None else ("AND project = ?", (project,))
        marks = ", ".join("?" * len(UNDONE))
        query = f"SELECT * FROM tasks WHERE state IN ({marks}) {where} ORDER BY id"
        return self._rows(query, *UNDONE, *values)

    def delete_task(self, task: int) -> None:
        """Forget a task; one that is gone is left alone."""
        with suppress(Missing):
            project = self.task(task)["project"]
            with self._changing(project) as data:
                self._forget(data, project, "task", "tasks", task)

    @staticmethod
    def _forget(data: sqlite3.Connection, project: str, kind: str, table: str, number: int) -> None:
        """Delete a row, and the event about it."""
        about = "project = ? AND kind = ? AND subject = ?"
        data.execute(f"DELETE FROM {table} WHERE id = ?", (number,))
        data.execute(f"DELETE FROM events WHERE {about}", (project, kind, str(number)))

    def change_task(self, task: int, **changes: Any) -> None:
        """Change columns of a task; one that is gone is left alone."""
        with suppress(Missing):
            project = self.task(task)["project"]
            with self._changing(project):
                self._update("tasks", task, changes)
                self._record(project, "task", task)

    # events

    def notice(self, project: str, text: str, *, warning: bool) -> None:
        """Tell a project's users something in words."""
        with suppress(Missing), self._changing(project):
            self.project(project)
            self._record(project, "notice", text, {"text": text, "warning": warning})

    @property
    def head(self) -> int:
        """The number of the last event."""
        return self._rows("SELECT coalesce(max(id), 0) AS head FROM events")[0]["head"]

    def events(self, project: str, after: int) -> list[dict[str, Any]]:
        """Return the events of a project after one, as `id`, `kind`, `subject` and `data`."""
        query = (
            "SELECT id, kind, subject, data FROM events WHERE project = ? AND id > ? ORDER BY id"
        )
        return self._rows(query, project, after)

    @contextmanager
    def still(self) -> Iterator[None]:
        """Let nobody change anything meanwhile."""
        with self._lock:
            yield


def _plain(row: sqlite3.Row) -> dict[str, Any]:
    """Return a row with what is JSON read."""
    record = dict(row)
    for name in (JSON | {"data"}) & set(record):
        record[name] = None if record[name] is None else json.loads(record[name])
    return record
