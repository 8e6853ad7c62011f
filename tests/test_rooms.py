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
    *("result_file", "search", "flowing", "page", "write", "pictures", "motifs", "make"),
    *("motion", "worlds", "solids"),
]
TILES += ["run_folder"]
DENSITY = ["data", "spaces", "models", "inference", "fitting"]
DENSITY += [
    *(
        "data_space",
        "random_state",
        "given_covariates",
        "estimator",
        "conditional_estimator",
        "comparing",
        "regions",
    ),
    *("weighed_rows", "uniformity", "summaries", "orientations", "tables", "pictures"),
    *("run_folder", "operations"),
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

TESTS = Path(__file__).parent
TESTED = {
    "tiles/art": ("tiles.make", "tiles.motifs", "tiles.page"),
    "tiles/exporting": ("tiles.make", "tiles.page"),
    "tiles/flowing": ("tiles.search",),
    "tiles/search": ("tiles.flowing",),
}
"""Rooms whose insides a folder of tests is about beside the room of its own name."""
PAST_DOORS = {
    "a tile with the map that a search would give it, without the search": [
        "artworks.py: tiles.search.bent_map",
        "studio/test_pulled_tiles.py: tiles.search.bent_map",
    ],
    "a run's document without a run": [
        "artworks.py: tiles.result_file",
        "exported.py: tiles.result_file",
    ],
    "what is saved is compared entry by entry": ["test_loading.py: tiles.result_file"],
    "the one list of a run's files": [
        "cli/test_batch.py: tiles.run_folder.files",
        "cli/test_escherize.py: tiles.run_folder.files",
        "runtime/test_running.py: tiles.run_folder.files",
    ],
    "a forced tile without a search": ["cli/test_escherize.py: tiles.search.finished_tiles"],
    "one bent silhouette for all tests, step by step": [
        "outlines.py: tiles.flowing.tile_model",
        "outlines.py: tiles.search.bending",
        "outlines.py: tiles.search.co_deformation",
    ],
    "makes searches small": [
        "small_pairs.py: tiles.search.pair_search",
        "small_searches.py: tiles.search.likeness_search",
        "test_page_commands.py: tiles.search.pair_search",
    ],
    "seals files that tests have damaged": ["sealed.py: runtime.tensor_files"],
    "the command line has no door: nobody imports it": ["settings/test_commands.py: cli.app"],
    "a mesh to upload": ["studio/test_browser_solid.py: solids.bodies"],
    "the studio takes what is read": ["studio/test_solid_pages.py: solids.reading"],
    "methods of one's own call them: see tiles/search/test_a_new_method.py": [
        "test_awkward_calls.py: tiles.flowing.starts",
        "test_awkward_calls.py: tiles.flowing.tile_model",
    ],
    "the most points of a map": ["tiles/search/test_carried.py: tiles.silhouette.bending"],
    "every frame, not the file": ["tiles/search/test_two_figures.py: tiles.motion.kinds"],
    "bodies sampled for it": ["tiles/silhouette/test_mesh.py: tiles.search.co_deformation"],
    "how lengths are read": [
        "tiles/exporting/test_export_settings.py: settings.kinds",
        "tiles/exporting/test_export_settings.py: settings.units",
    ],
    "what is said where an extra is missing": ["test_without_extras.py: settings.extras"],
    "a worker's part, here": ["density/cross_validation/test_cross_validation.py: batch.parcels"],
    "the operation that draws": ["density/pictures/test_plots.py: density.operations.drawing"],
}
"""Imports past a door in tests, `file: module`, by their reasons."""


class Import(NamedTuple):
    """A name that a file imports: from where, and in which file that is defined."""

    file: Path
    source: str
    name: str
    module: str
    for_types: bool

    def __str__(self) -> str:
        return f"{self.file.relative_to(HOME)}: {self.source}.{self.name}"


def dotted(path: Path) -> str:
    parts = path.relative_to(HOME.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {dotted(path): path for path in sorted(HOME.rglob("*.py"))}
FILES = {name for name, path in MODULES.items() if path.name != "__init__.py"}
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


@cache
def all_imports() -> list[Import]:
    """Of all files: read when a test asks, as every worker collects this file."""
    return [line for path in MODULES.values() for line in imports(path)]


def imports(path: Path) -> Iterator[Import]:
    tree = ast.parse(path.read_text("utf-8"))
    typing = set(for_type_checkers(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("orbiflow"):
            assert node.module
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                module = whole if whole in MODULES else door_or_module(node.module, alias.name)
                yield Import(path, node.module, alias.name, module, node in typing)


def for_type_checkers(tree: ast.Module) -> Iterator[ast.AST]:
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            yield from (inside for statement in node.body for inside in ast.walk(statement))


def door_or_module(source: str, name: str) -> str:
    return door(source).get(name, source) if source in PACKAGES else source


@cache
def room(module: str) -> str:
    """The longest room that holds a module; "" for a file at the top, which all share."""
    inside = module.removeprefix("orbiflow").lstrip(".")
    holding = [name for name in ROOMS if inside == name or inside.startswith(name + ".")]
    return max(holding, key=len, default="")


def test_every_folder_is_in_a_room() -> None:
    assert all(room(package) for package in PACKAGES if package != "orbiflow")


def test_a_room_imports_only_rooms_before_it() -> None:
    places = {"": 0, **{name: place for place, name in enumerate(ROOMS, 1)}}
    for found in all_imports():
        own = dotted(found.file)
        if own not in ("orbiflow", "orbiflow.__main__"):
            assert places[room(found.module)] <= places[room(own)], str(found)


def test_the_wings_do_not_know_each_other() -> None:
    for found in all_imports():
        wings = (
            {dotted(found.file).split(".")[1:2][0], found.module.split(".")[1:2][0]}
            if found.module != "orbiflow" and dotted(found.file) != "orbiflow"
            else set()
        )
        assert wings != {"tiles", "density"}, str(found)


def test_no_circles() -> None:
    """Imports in functions count as those at the start of a file do, imports for types do not."""
    graph: dict[str, set[str]] = {}
    for found in all_imports():
        own = dotted(found.file)
        if not found.for_types and found.module not in (own, *PACKAGES):
            graph.setdefault(own, set()).add(found.module)
    try:
        list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        pytest.fail(f"imports in a circle: {error.args[1]}")


def test_imports_go_through_doors() -> None:
    past: list[str] = []
    for found in all_imports():
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


def past_doors(path: Path) -> Iterator[str]:
    """Names that a test takes from the inside of a room that is not its own.

    A module that is imported whole is there to be changed for a test; a folder's tests, too, may use
    the files beside its room, such as `tiles.tile_map` for those of `tiles.flowing`.
    """
    folder = path.parent.relative_to(TESTS).as_posix()
    rooms = () if folder == "." else (folder.replace("/", "."), *TESTED.get(folder, ()))
    text = path.read_text("utf-8")
    for node in ast.walk(ast.parse(text)) if "from orbiflow." in text else ():
        if not isinstance(node, ast.ImportFrom) or node.module not in FILES:
            continue
        module = node.module.removeprefix("orbiflow.")
        package, _, file = module.rpartition(".")
        own = any(f"{package}.".startswith(f"{room}.") for room in rooms)
        beside = any(room.startswith(f"{package}.") for room in rooms)
        whole = all(f"{node.module}.{alias.name}" in MODULES for alias in node.names)
        if package and file and not (own or beside or whole):
            yield f"{path.relative_to(TESTS).as_posix()}: {module}"


def test_tests_go_through_doors() -> None:
    past = {found for path in TESTS.rglob("*.py") for found in past_doors(path)}
    assert past == {place for places in PAST_DOORS.values() for place in places}


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
    for found in all_imports():
        parts = (*found.source.split("."), found.name)
        assert not any(p.startswith("_") and not p.startswith("__") for p in parts), str(found)
