"""Imports point one way and go through doors; a private name stays in its file."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

HOME = Path(__file__).parents[1] / "src" / "orbiflow"

TILES = ["geometry", "tilings", "silhouette", "likeness", "tile_map", "tile"]
TILES += [
    "result_file",
    "search",
    "flowing",
    "page",
    "write",
    "pictures",
    "motifs",
    "make",
    "motion",
    "worlds",
    "solids",
]
TILES += ["run_folder"]
DENSITY = ["data", "spaces", "models", "inference", "fitting"]
DENSITY += [
    "data_space",
    "estimator",
    "covariates",
    "conditional_estimator",
    "comparing",
    "regions",
    "weighed_rows",
    "uniformity",
    "summaries",
    "orientations",
    "tables",
    "pictures",
    "run_folder",
    "operations",
]
DENSITY += ["cross_validation"]
ROOMS = [
    *("settings", "runtime", "symmetry", "fields", "flows", "drawing", "batch"),
    *(f"tiles.{room}" for room in TILES),
    *(f"density.{room}" for room in DENSITY),
    *("tiles", "density", "solids", "loading", "studio", "cli"),
]
"""Each room may import those before it; a wing's own files come after its rooms."""

EXCEPTIONS: dict[str, str] = {}
"""Imports that may go past a door, `file: module`, each with its reason."""


class Import(NamedTuple):
    """A name that a file imports: from where, and in which file that is defined."""

    file: Path
    source: str
    name: str
    module: str
    at_start: bool
    for_types: bool

    def __str__(self) -> str:
        return f"{self.file.relative_to(HOME)}: {self.source}.{self.name}"


def dotted(path: Path) -> str:
    parts = path.relative_to(HOME.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {dotted(path): path for path in sorted(HOME.rglob("*.py"))}
PACKAGES = {name for name, path in MODULES.items() if path.name == "__init__.py"}


@cache
def door(package: str) -> dict[str, str]:
    """The names that a package offers, and the module that each comes from."""
    stub = MODULES[package].with_suffix(".pyi")
    offered: dict[str, str] = {}
    for node in ast.walk(ast.parse(stub.read_text("utf-8"))) if stub.exists() else ():
        if isinstance(node, ast.ImportFrom):
            offered |= {alias.name: f"{package}.{node.module}" for alias in node.names}
    return offered


def imports(path: Path) -> Iterator[Import]:
    tree = ast.parse(path.read_text("utf-8"))
    typing = set(for_type_checkers(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("orbiflow"):
            assert node.module
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                module = whole if whole in MODULES else door_or_module(node.module, alias.name)
                yield Import(
                    path, node.module, alias.name, module, node in tree.body, node in typing
                )


def for_type_checkers(tree: ast.Module) -> Iterator[ast.AST]:
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            yield from (inside for statement in node.body for inside in ast.walk(statement))


def door_or_module(source: str, name: str) -> str:
    return door(source).get(name, source) if source in PACKAGES else source


ALL = [found for path in MODULES.values() for found in imports(path)]


def room(module: str) -> str:
    """The longest room that holds a module; "" for a file at the top, which all share."""
    inside = module.removeprefix("orbiflow").lstrip(".")
    holding = [name for name in ROOMS if inside == name or inside.startswith(name + ".")]
    return max(holding, key=len, default="")


def test_every_folder_is_in_a_room() -> None:
    assert all(room(package) for package in PACKAGES if package != "orbiflow")


@pytest.mark.parametrize("name", ["", *ROOMS])
def test_a_room_imports_only_rooms_before_it(name: str) -> None:
    allowed = {"", *ROOMS[: ROOMS.index(name) + 1]} if name else {""}
    for found in ALL:
        own = dotted(found.file)
        if room(own) == name and own not in ("orbiflow", "orbiflow.__main__"):
            assert room(found.module) in allowed, str(found)


def test_the_wings_do_not_know_each_other() -> None:
    for found in ALL:
        wings = (
            {dotted(found.file).split(".")[1:2][0], found.module.split(".")[1:2][0]}
            if found.module != "orbiflow" and dotted(found.file) != "orbiflow"
            else set()
        )
        assert wings != {"tiles", "density"}, str(found)


def test_no_circles() -> None:
    """Imports in functions count as those at the start of a file do, imports for types do not."""
    graph: dict[str, set[str]] = {}
    for found in ALL:
        own = dotted(found.file)
        if not found.for_types and found.module not in (own, *PACKAGES):
            graph.setdefault(own, set()).add(found.module)
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"imports in a circle: {error.args[1]}")


def test_imports_go_through_doors() -> None:
    past: list[str] = []
    for found in ALL:
        here = dotted(found.file)
        own = (here if here in PACKAGES else here.rpartition(".")[0]).split(".")
        if own[1:2] == ["cli"]:
            continue  # these rooms have no doors yet
        whole = f"{found.source}.{found.name}"
        parts = (whole if whole in MODULES else found.source).split(".")
        common = sum(1 for _ in iter_common(own, parts))
        if common < len(own) and len(parts) > common + 1 and str(found) not in EXCEPTIONS:
            past.append(str(found))
    assert not past


def iter_common(one: list[str], other: list[str]) -> Iterator[str]:
    for a, b in zip(one, other, strict=False):
        if a != b:
            return
        yield a


def test_doors_offer_what_is_there() -> None:
    for package in PACKAGES:
        for name, module in door(package).items():
            assert f"{package}.{name}" not in MODULES, f"{package}.{name} is a file and a name"
            assert name in MODULES[module].read_text("utf-8"), f"{module} has no {name}"


def test_private_names_stay_in_their_file() -> None:
    for found in ALL:
        parts = (*found.source.split("."), found.name)
        assert not any(p.startswith("_") and not p.startswith("__") for p in parts), str(found)
