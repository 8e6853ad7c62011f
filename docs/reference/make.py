"""The reference page of all operations and settings, settings.md: `python docs/reference/make.py`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from orbiflow.commands import OPERATIONS
from orbiflow.errors import SettingError
from orbiflow.runtime import Operation, find
from orbiflow.settings import Field, Hidden

PAGE = Path(__file__).with_name("settings.md")

TOP = """# Operations and settings

This page is made by `python docs/reference/make.py` from the operations
themselves. Each is a command, a Python function and a JSON object: an option `--tile-size` is the
argument or setting `tile_size` in Python and JSON. Settings in *italics* have no option.
"""


def reference(operations: Iterable[Operation]) -> str:
    """Return the page in Markdown."""
    return "\n".join([TOP, *map(_section, operations)])


def _section(operation: Operation) -> str:
    lines = [f"## {operation.name}", "", operation.doc, ""]
    headings = dict.fromkeys(["", *(entry.group for entry in operation.fields)])
    for heading in headings:
        entries = [entry for entry in operation.fields if entry.group == heading]
        if not entries:
            continue
        if heading:
            lines += [f"### {operation.name}: {heading}", ""]
        lines += ["| setting | value | default | |", "|---|---|---|---|"]
        lines += [_row(entry) for entry in entries]
        lines.append("")
    return "\n".join(lines)


def _row(entry: Field) -> str:
    value = " \\| ".join(entry.kind.choices) or entry.kind.wanted
    default = "required" if entry.required else entry.default_text
    rules = " and ".join(SettingError(str(rule)).named(_code) for rule in entry.rules if str(rule))
    note = f" Only with {rules}." if rules else ""
    return f"| {_name(entry)} | {value} | {default} | {entry.doc}{note} |"


def _name(entry: Field) -> str:
    if entry.of_class(Hidden):
        return f"*{entry.name}*"
    if entry.positional:
        return f"`{entry.name.upper()}`"
    names = (*entry.option.names, *([entry.option.off] if entry.option.off else []))
    return " ".join(map(_code, names))


def _code(name: str) -> str:
    return f"`{name}`"


if __name__ == "__main__":
    PAGE.write_text(reference(map(find, OPERATIONS)), "utf-8")
