"""Imports point one way, as docs/architecture.md lists the rooms, and private names stay at home."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HOME = ROOT / "src" / "orbiflow"
ROOMS = re.findall(r"^\| `(\w+)` \|", (ROOT / "docs" / "architecture.md").read_text("utf-8"), re.M)


def imports(path: Path) -> Iterator[tuple[str, str]]:
    """Modules of orbiflow, and the names that are imported from them."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and not node.level:
            yield from ((node.module, alias.name) for alias in node.names)
        elif isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)


def room(module: str) -> str:
    """The room of a module, "" for a file that all share."""
    parts = module.split(".")
    return parts[1] if len(parts) > 1 and (HOME / parts[1]).is_dir() else ""


@pytest.mark.parametrize("name", ROOMS)
def test_a_room_imports_what_stands_above_it(name: str) -> None:
    allowed = {"", *ROOMS[: ROOMS.index(name) + 1]}
    paths = list((HOME / name).rglob("*.py"))
    assert paths
    for path in paths:
        for module, _ in imports(path):
            if module.split(".")[0] == "orbiflow":
                assert room(module) in allowed, f"{path}: {module}"


def test_what_all_share_imports_no_room() -> None:
    for path in HOME.glob("*.py"):
        if path.name not in ("__init__.py", "__main__.py"):
            for module, _ in imports(path):
                assert not module.startswith("orbiflow.") or not room(module), f"{path}: {module}"


def test_all_rooms_are_listed() -> None:
    assert sorted(ROOMS) == sorted(p.parent.name for p in HOME.glob("*/__init__.py"))


def test_private_names_stay_in_their_file() -> None:
    for path in HOME.rglob("*.py"):
        for module, name in imports(path):
            if module.split(".")[0] == "orbiflow":
                private = [part for part in (*module.split("."), name) if re.match("_[^_]", part)]
                assert not private, f"{path}: {private} of {module}"
