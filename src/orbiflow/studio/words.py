"""Projects and tasks as pages show them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Any

from orbiflow.errors import Advice
from orbiflow.studio.store import Store

NAMES = {"tile": "New tile", "density": "New density", "solid": "New solid"}
"""What a project of each kind is called before it has a name."""

OF_PICTURE = ("", "-2")
"""What the names of the files of a project's first and second picture end in."""

PREFIXES = ("", "second_")
"""What settings and arguments of the first figure begin with, and those of the second."""

LABELS = {
    "tile_size": "the length of a tile",
    "area": "the width and height",
    "dpi": "the number of dots per inch",
    "fps": "the number of pictures per second",
    "threshold": "edge (Where it ends)",
    "invert": "side (The animal is)",
    "smooth": "smoothing",
    "thicken": "Thin parts",
    "unit": "“How angles are counted”",
}
"""What the pages call settings whose names say too little."""


def page_words(text: str) -> str:
    """Return a message with settings called what the page calls them.

    >>> page_words(Advice("raise the contrast or try another {threshold}"))
    'raise the contrast or try another edge (Where it ends)'
    """
    if isinstance(text, Advice):
        return text.named(lambda name: LABELS.get(name, name.replace("_", " ")))
    return text


PAINTED = {
    "mend": "what you added or removed",
    "pins": "what you painted with “Keep its shape”",
    "emphasis": "what you painted with “Matters most”",
}
"""What messages call the files of what is painted over a picture."""

MASKS = tuple(PAINTED)
"""What is painted over a picture."""


def own_names(text: str, project: Mapping[str, Any]) -> str:
    """Return a message with the user's own names of files, in place of the studio's.

    >>> own = {"input": {"name": "cat.svg", "type": "svg"}, "second": None}
    >>> own_names("input.svg: no page; pins.png: not on it", own)
    'cat.svg: no page; what you painted with “Keep its shape”: not on it'
    """
    names = {f"{name}{end}.png": words for end in OF_PICTURE for name, words in PAINTED.items()}
    for end, picture in zip(OF_PICTURE, (project, project["second"]), strict=True):
        if picture and (file := picture["input"]):
            called = file["name"]
            names |= {f"{name}{end}.{file['type']}": called for name in ("input", "table", "mesh")}
    every = "|".join(map(re.escape, names))
    return re.sub(rf"(?<![\w-])({every})", lambda match: names[match[1]], text)


def plain_name(typed: Any, otherwise: str) -> str:
    """Return a name on one line, without folders.

    >>> plain_name("C:\\\\cats\\\\cat.png", "picture"), plain_name("../..", "picture")
    ('cat.png', 'picture')
    """
    text = typed if isinstance(typed, str) else ""
    text = PurePosixPath(text.replace("\\", "/")).name
    name = "".join(letter for letter in text if letter.isprintable()).strip(" .")
    return name[:80] or otherwise


def plain_letters(name: str, otherwise: str) -> str:
    """Return a name in letters and digits that any system takes in a file's name.

    >>> plain_letters("My Schildkröte!", "tile"), plain_letters("龜", "tile")
    ('my-schildkrote', 'tile')
    """
    letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode().lower()
    return re.sub(r"[^a-z0-9]+", "-", letters)[:40].strip("-") or otherwise


def what_task(store: Store, task: dict[str, Any]) -> str:
    """Return what a task does, for those that take about as long: "search normal of two"."""
    settings = task["settings"]
    chosen = (settings.get(name) for name in ("effort", "purpose", "kind", "world"))
    words = [task["operation"], *filter(None, chosen)]
    if task["operation"] == "search" and store.project(task["project"])["second"]:
        words.append("of two")
    return " ".join(words)


def shown_task(store: Store, task: dict[str, Any]) -> dict[str, Any]:
    """Return what a browser needs of a task."""
    place = 0
    if task["state"] == "waiting":
        place = sum(
            other["state"] == "waiting"
            and other["lane"] == task["lane"]
            and other["id"] < task["id"]
            for other in store.undone()
        )
    names = ("id", "operation", "state", "share", "what", "error", "result")
    usual = store.took.get(what_task(store, task))
    return {name: task[name] for name in names} | {"place": place, "usual": usual}


def shown_project(store: Store, project: dict[str, Any], kind: str = "") -> dict[str, Any]:
    """Return what a browser needs of a project; of one kind of event, the part that it changed."""
    project_id = project["id"]
    home, address = store.home(project_id), f"/api/projects/{project_id}"

    def url(file: str) -> str | None:
        path = home / f"{file}.png"
        return f"{address}/{file}.png?{path.stat().st_mtime_ns}" if path.exists() else None

    if kind == "project":
        return {name: project[name] for name in ("name", "view", "changed_by")}

    def shown(half: dict[str, Any], number: int) -> dict[str, Any]:
        silhouette, end = half["silhouette"], OF_PICTURE[number]
        if silhouette is not None:
            silhouette = {**silhouette, "backdrop": url(f"backdrop{end}")}
        usual = {"threshold": None, "invert": None, "smooth": 0.0, "thicken": 0.0}
        return {
            "input": half["input"],
            "reading": usual | half["reading"],
            "silhouette": silhouette,
            **{mask: url(f"{mask}{end}") for mask in MASKS},
        }

    second = project["second"]
    part = {**shown(project, 0), "second": None if second is None else shown(second, 1)}
    if kind == "silhouette":
        return part
    names = ("id", "kind", "name", "created", "changed", "view")
    return {
        **{name: project[name] for name in names},
        **part,
        "tiles": store.cards(project_id),
        "tasks": [shown_task(store, task) for task in store.tasks(project_id)],
        "took": store.took,
        "head": store.head,
    }


def is_outdated(card: dict[str, Any], project: dict[str, Any]) -> bool:
    """Whether a tile was found for an outline that has been changed or removed since."""
    pictures = [project, project["second"]]
    marks = [(image.get("silhouette") or {}).get("mark") if image else "none" for image in pictures]
    pairs = zip(card.get("found_for", ()), marks, strict=False)
    return any(mark and mark != earlier for earlier, mark in pairs)


def shown_summary(store: Store, summary: dict[str, Any]) -> dict[str, Any]:
    """Return what the list of projects shows of one."""
    drawn = summary.pop("drawn")
    if summary["kind"] == "solid":
        drawn = (store.home(summary["id"]) / "backdrop.png").is_file()
    thumb = f"/api/projects/{summary['id']}/backdrop.png" if drawn else None
    return {**summary, "busy": bool(summary["busy"]), "thumb": thumb}
