"""The kinds of task that a project can have, and the call that a worker is given for each."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from contextlib import suppress
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import Call, Operation, find
from orbiflow.settings import Field, Hidden, NotWith, OnlyWith, PathKind
from orbiflow.studio.words import LABELS, plain_letters

SERVER_SET = ("project", "task", "force", "workers", "tile", "picture", "profile")
"""Parameters of operations that the server sets, or nobody."""


@dataclass(frozen=True)
class TaskKind:
    """A kind of task.

    - `work`: The operation that does it, in `orbiflow.settings.commands.WORK`, of a `Job`.
    - `lane`: "quick" for what somebody waits for; it waits for no search.
    - `makes`: Of a take-away, the operation that writes it; of a preview, the settings name it.
    """

    work: str
    lane: Literal["quick", "long"] = "long"
    makes: str = ""

    def call(self, home: Path, task: int, settings: Mapping[str, Any]) -> Call:
        """Return the call of a task. Raises `SettingError` for settings that cannot be used."""
        place = {"project": home, "task": task}
        makes = self.makes or settings.get("makes", "")
        if not makes:
            if taken := [name for name in place if name in settings]:
                raise SettingError(f"the studio itself sets {taken[0]}; leave it out")
            return find(self.work).call({**place, **settings})
        outer = {name: settings[name] for name in TAKE_SETTINGS if name in settings}
        rest = {name: value for name, value in settings.items() if name not in (*outer, "makes")}
        making_call(makes, rest, Path("tile"))
        return find(self.work).call(
            {**place, **outer, "makes": makes, "settings": json.dumps(rest)}
        )


TAKE_SETTINGS = ("tile", "picture", "drawing", "called", "side")
"""Settings of a take-away besides those of its operation."""

WITH_DRAWING = ("export", "art", "solid", "animate")
"""What shows the drawing on a tile."""

READS = ("read", "read second")
"""The kind of task that reads the first picture of a project, and the second."""

KINDS = {
    **dict.fromkeys(READS, TaskKind("studio read", "quick")),
    "open": TaskKind("studio open", "quick"),
    "search": TaskKind("studio search"),
    "space": TaskKind("studio space", "quick"),
    "pull": TaskKind("studio pull", "quick"),
    "class": TaskKind("studio class", "quick"),
    "preview": TaskKind("studio preview", "quick"),
    "export": TaskKind("studio take", makes="export"),
    "art": TaskKind("studio take", makes="art"),
    "solid": TaskKind("studio take", makes="solid"),
    "animate": TaskKind("studio take", makes="animate"),
    "mesh read": TaskKind("studio mesh", "quick"),
    "fill": TaskKind("studio fill"),
    "film": TaskKind("studio film"),
    "build": TaskKind("studio take", makes="build"),
    "density table": TaskKind("studio table", "quick"),
    "density fit": TaskKind("studio density"),
    "density map": TaskKind("studio density map", "quick"),
    "density take": TaskKind("studio density take"),
}


def kind_of_work(operation: str) -> TaskKind:
    """Return the kind of task of a name."""
    if operation not in KINDS:
        raise OrbiflowError(f"there is no such task; there are {', '.join(KINDS)}")
    return KINDS[operation]


def own_fields(operation: Operation) -> list[Field]:
    """Return the settings of an operation that make sense in the studio."""
    return [
        entry
        for entry in operation.fields
        if entry.name == "format"
        or not (entry.is_of(PathKind) or entry.of_class(Hidden) or entry.name in SERVER_SET)
    ]


def _needed(entry: Field) -> dict[str, list[Any]]:
    """Return the values that other settings must have where one applies, by their names."""
    needed: dict[str, list[Any]] = {}
    for rule in entry.rules:
        if isinstance(rule, OnlyWith):
            needed |= {name: list(values) for name, values in rule.others.items()}
        elif isinstance(rule, NotWith):
            needed |= {name: [None, False] for name in rule.others}
    return needed


def own_schema(operation: Operation) -> dict[str, Any]:
    """Return the JSON Schema of what a browser may set of an operation, and this machine can make."""
    properties = {
        entry.name: {
            **deepcopy(entry.schema),
            "x-group": entry.group,
            "x-default": entry.default_text,
            "x-only-with": _needed(entry),
        }
        for entry in own_fields(operation)
    }
    if operation.name == "animate" and shutil.which("ffmpeg") is None:
        for kind in properties["format"].get("anyOf", [properties["format"]]):
            kind["enum"] = [name for name in kind.get("enum", ()) if name != "mp4"]
    return {**operation.schema, "properties": properties, "required": []}


def presets(makes: str) -> dict[str, dict[str, dict[str, Any]]]:
    """Return, by setting and choice, the defaults of a take-away's other settings that it changes.

    >>> presets("solid")["kind"]["cutter"]
    {'tile_size': 80.0, 'height': 13.0, 'wall': 1.2, 'warn_neck': 5.0}
    """
    fields = own_fields(find(makes))

    def values(**given: Any) -> dict[str, Any]:
        flat = making_call(makes, given, Path("tile")).flat
        return {entry.name: entry.kind.plain(flat[entry.name]) for entry in fields}

    usual, changes = values(), dict[str, dict[str, dict[str, Any]]]()
    for entry in fields:
        for choice in entry.kind.choices:
            with suppress(SettingError):  # goes only with others
                chosen = values(**{entry.name: choice}) | {entry.name: usual[entry.name]}
                changed = {name: value for name, value in chosen.items() if value != usual[name]}
                changes.setdefault(entry.name, {})[choice] = changed
    return changes


def making_call(makes: str, settings: Mapping[str, Any], result: Path, **files: Any) -> Call:
    """Return the call that writes a take-away with settings from a browser.

    Raises `SettingError` for a setting that the studio does not take, or a value that is not allowed.
    """
    made = find(makes)
    allowed = {entry.name for entry in own_fields(made)}
    if strange := [name for name in settings if name not in allowed]:
        names = literal(", ".join(sorted(allowed)))
        raise SettingError(f"{makes} takes {names} here, not {literal(strange[0])}")
    try:
        return made.call({"result": result, **settings, **files})
    except SettingError as error:
        raise RefusedSetting(setting_words(error, made), error.about) from error


class RefusedSetting(SettingError):
    """A refusal in the page's words, and the `setting` that it is about, "" if it is about none."""

    def __init__(self, text: str, setting: str) -> None:
        super().__init__(literal(text))
        self.setting = setting


def setting_words(error: SettingError, operation: Operation) -> str:
    """Return a refusal with the page's names of settings, and units where it has none.

    >>> setting_words(SettingError("{tile_size} must be at most 20000"), find("export"))
    'the length of a tile (in mm) must be at most 20000'
    """
    units = {entry.name: entry.schema.get("x-unit", "") for entry in operation.fields}

    def called(name: str) -> str:
        words, unit = LABELS.get(name, name.replace("_", " ")), units.get(name, "")
        return words if unit in error.template else f"{words} (in {unit})"

    return error.named(called)


def file_name(call: Call, called: str) -> str:
    """Return a name for the file that a call writes, such as cat-laser-60mm.svg.

    What is drawn is named where it is not what the purpose usually has: cat-laser-jigsaw-60mm.svg.
    """
    chosen = call.arguments["settings"]

    def cut() -> str | None:
        usual = type(chosen)(purpose=chosen.purpose).cut
        return None if chosen.cut == usual else "filled" if chosen.cut == "none" else chosen.cut

    more = {
        "export": lambda: [chosen.purpose, cut(), f"{chosen.tile_size:g}mm"],
        "art": lambda: ["picture"],
        "solid": lambda: [chosen.kind],
        "build": lambda: [chosen.kind],
    }.get(call.operation.name, list)()
    return f"{'-'.join([plain_letters(called, 'tile'), *filter(None, more)])}.{chosen.file_format}"
