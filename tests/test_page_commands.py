"""Every command of `orbiflow` that a page prints in a block of its own runs there, in the page's order.

Searches and fits try little, and tables have few rows: what they find is tested where they are made.
"""

import json
import os
import shutil
import zlib
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from PIL import Image
from scipy.spatial.transform import Rotation

from cli.conftest import call_main
from density.quick_fits import quick_fits, quick_pictures, small_sheets
from orbiflow.solids import Mesh
from orbiflow.solids import search as solid_search
from orbiflow.tiles import LikenessSearch
from orbiflow.tiles.search.pair_search import PairSearch
from shell_lines import ROOT, Line
from small_pairs import FEW as FEW_PAIRS
from small_pairs import small_pairs
from small_searches import FEW, small_searches
from solids.known_solids import creature
from solids.small_fills import small_fills
from test_shell_lines import LINES
from tiles.exporting.conftest import hasty_nesting

COMMANDS = [line for line in LINES if line.whole and line.words[0] == "orbiflow"]
PAGES = sorted({line.page for line in COMMANDS})

BEFORE = {"docs/density-pictures.md": ("density fit quakes.csv --space sphere --out quakes",)}
"""What a reader of a page has done before."""

NOT_HERE = {
    "studio": "a server without an end: tests/studio starts it",
    "--scheduler": "needs a cluster: tests/batch has one",
    "--pairs": "tests/batch has the smallest folder of pairs",
    "MODEL": "stands for any model",
    "--profile": "takes a profile of the reader's: tests/tiles/exporting has one",
    "examples/silhouettes/nagata/spider_120.dat": "finds no pair where so little is tried",
    "examples/silhouettes/nagata/dolphin_60.dat": "a pair as that of the seal and the shark",
    "by-hour": "a fit to covariates as that of the weather",
}

FINDS = {
    "escherize examples/silhouettes/turtle.png --out out/turtle": "--classes IH4",
    "escherize examples/silhouettes/barbet.svg --classes IH5,IH7,IH21,IH28 --out out/barbet": "",
    "escherize examples/silhouettes/squirrel.dat --out out/squirrel": "--classes IH4",
    "escherize docs/gallery/silhouettes/seal.svg --out out/seal": "--classes IH5",
    "escherize docs/gallery/silhouettes/seal.svg docs/gallery/silhouettes/shark.svg --out out/pair": "",
    "fill examples/meshes/koala.obj --out out/koala": "--detail 5000 --groups P-1",
}
"""What pages begin with, done once for all of them, and what makes it smaller."""

DONE = {*FINDS, "escherize examples/silhouettes/barbet.svg --out out/barbet"}

SMALLER = {
    "art": ("--area", "150x100px"),
    "animate": ("--area", "120x80px"),
    "batch": ("--classes", "IH4"),
    "density cv": ("--folds", "2"),
    "export out/barbet": ("--area", "120x80mm"),
    "export out/pair": ("--area", "120x80mm"),
    "export out/turtle --for laser --cut jigsaw": ("--area", "150x120mm"),
    "build out/koala --kind puzzle": ("--copies", "3"),
}
"""Options of commands that do not have them, so that less is drawn or tried."""

LARGE = {
    "art": {
        **{"3000x2000px": "150x100px", "594x420mm": "90x60mm", "300x200mm": "60x40mm"},
        "9cm": "2cm",
    },
    "export": {"300x200mm": "120x80mm", "60": "6"},
}
"""Sizes of artwork, sizes and numbers of pieces, and what is drawn instead."""

COLUMNS = {
    "his": "phi,psi,chi1,chi2,protein", "his-fitted": "phi,psi,protein", "trp": "phi,psi,protein",
    "his-held": "phi,psi,protein", "turned": "lat,lon,polarity", "a": "angle", "b": "angle",
    "angles": "phi,psi", "model": "phi,psi", "bonds": "phi,length,temperature",
    "weather": "wind_dir,hour,temperature,pressure,airport,day", "motifs": "x,y",
    "waters": "x,y,z", "turns": "x,y,z,w", "fires": "latitude,longitude", "cells": "lat,lon,cell",
    "quakes": "lat,lon", "quakes-fitted": "lat,lon", "quakes-held": "lat,lon", "ring": "lat,lon",
    "rolled": "phi1,Phi,phi2", "directions": "lat,lon", "poles": "lat,lon",
}  # fmt: skip
OF_A_PAGE = {
    ("docs/columns.md", "wind"): "dir,speed,w,day,hour,site",
    ("docs/conditionals.md", "new"): COLUMNS["weather"],
    ("docs/densities.md", "new"): "lat,lon,phi,length,temperature",
    ("docs/densities.md", "places"): "day,lon,lat,depth",
    ("docs/quotients.md", "places"): "x,y,z",
    ("docs/summaries.md", "poles"): "plat,plon",
}
COAST = {"type": "LineString", "coordinates": [[0, 0], [20, 30], [60, 40]]}
ROWS = 60
LENGTHS = {"length", "temperature", "pressure", "depth", "speed", "w", "x", "y", "z"}


def column(name: str, count: int, random: np.random.Generator) -> list[object]:
    """Some values that a column of this name may have."""
    if name in ("protein", "cell", "airport", "polarity", "site"):
        words = {"polarity": "NR", "airport": ["JFK", "EWR"]}.get(name, "ABCDEFGHIJKL")
        return [words[k % len(words)] for k in range(count)]
    if name in ("hour", "day"):
        return [float(k % 24) + 0.5 for k in range(count)]
    if name in LENGTHS:
        return (random.normal(size=count) + 5).round(3).tolist()
    if "lat" in name:
        return np.degrees(np.arcsin(random.uniform(-0.9, 0.9, count))).round(3).tolist()
    return random.normal(1, 0.5, count).round(3).tolist()


def write_table(path: Path, columns: str) -> None:
    random = np.random.default_rng(zlib.crc32(path.stem.encode()))
    names = columns.split(",")
    rows = zip(*(column(name, ROWS, random) for name in names), strict=True)
    if columns == "x,y,z,w":
        rows = Rotation.random(ROWS, rng=random).as_quat()
    path.write_text("\n".join([columns, *(",".join(map(str, row)) for row in rows)]) + "\n")


def write_obj(path: Path, mesh: Mesh) -> None:
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in mesh.points]
    path.write_text("\n".join([*lines, *(f"f {a} {b} {c}" for a, b, c in mesh.faces + 1)]))


@pytest.fixture(scope="module", name="_little")
def little_fixture() -> Iterator[pytest.MonkeyPatch]:
    """Searches at any effort, fits and pictures try little."""
    with ExitStack() as stack:
        for make in (small_searches, small_pairs, small_fills):
            stack.enter_context(make())
        patch = stack.enter_context(pytest.MonkeyPatch.context())
        patch.setitem(LikenessSearch.efforts, "normal", FEW)  # pyright: ignore[reportArgumentType]
        coarse = solid_search.EFFORTS["fast"]._replace(grain=0.08)
        patch.setitem(solid_search.EFFORTS, "normal", coarse)
        patch.setitem(PairSearch.efforts, "normal", FEW_PAIRS)  # pyright: ignore[reportArgumentType]
        quick_fits(patch)
        quick_pictures(patch)
        small_sheets(patch)
        stack.enter_context(hasty_nesting())
        yield patch


@pytest.fixture(scope="module", name="workshop")
def workshop_fixture(tmp_path_factory: pytest.TempPathFactory, _little: object) -> Path:
    """A folder as readers have it who did what pages begin with; made once a run, never changed."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "workshop"
    with FileLock(f"{folder}.lock"), pytest.MonkeyPatch.context() as patch:
        if not folder.exists():
            new = folder.with_name("workshop-new")
            (new / "out").mkdir(parents=True)
            patch.chdir(new)
            bring_files(new)
            for words, smaller in FINDS.items():
                done = call_main(lambda: ("", ""), *f"{words} {smaller}".split())
                assert done.status == 0, words
            new.rename(folder)
    return folder


def bring_files(folder: Path) -> None:
    """Bring the files that pages read: the repository's own, and small ones as readers may have."""
    (folder / "docs").symlink_to(ROOT / "docs")
    shutil.copytree(ROOT / "examples", folder / "examples")
    write_obj(folder / "examples" / "meshes" / "koala.obj", creature())
    for table in (folder / "examples" / "density").glob("*.csv"):
        table.write_text("".join(table.read_text().splitlines(keepends=True)[: ROWS + 1]))
    for name in ("animals", "angles"):
        (folder / name).mkdir()
    shutil.copy(ROOT / "examples" / "silhouettes" / "turtle.png", folder / "animals")
    for name in "ab":
        write_table(folder / "angles" / f"{name}.csv", "phi,psi")
    Image.new("RGB", (192, 192), "olive").save(folder / "turtle-painted.png")
    shutil.copy(ROOT / "examples/silhouettes/turtle.png", folder)
    for name, shape in (("bird", "seal"), ("dolphin", "shark")):
        shutil.copy(ROOT / f"docs/gallery/drawings/{shape}.svg", folder / f"{name}.svg")
    (folder / "coast.geojson").write_text(json.dumps(COAST))
    for name, columns in COLUMNS.items():
        write_table(folder / f"{name}.csv", columns)


def smaller(words: list[str]) -> list[str]:
    """The same command with less to draw or to try."""
    words = [LARGE.get(words[0], {}).get(word, word) for word in words]
    if "--folds" in words:
        given = words.index("--folds") + 1
        words = [*words[:given], "2", *words[given + 1 :]]
    if words[:2] == ["density", "cv"]:
        words = ["mixture" if word == "flow" else word for word in words]
    for command, (option, value) in SMALLER.items():
        if " ".join(words).startswith(command) and not {option, "--repeat"} & {*words}:
            words = [*words, option, value]
    return words


@pytest.mark.parametrize("page", PAGES)
def test_a_page(page: str, workshop: Path, tmp_path, monkeypatch, capsys) -> None:
    desk = shutil.copytree(workshop, tmp_path / "desk", symlinks=True)
    monkeypatch.chdir(desk)
    for (of, name), columns in OF_A_PAGE.items():
        if of == page:
            write_table(desk / f"{name}.csv", columns)
    refused = []
    before = [Line(page, f"orbiflow {words}", whole=True) for words in BEFORE.get(page, ())]
    for line in [*before, *(line for line in COMMANDS if line.page == page)]:
        words = line.words[1:]
        if " ".join(words) in DONE or NOT_HERE.keys() & {*words}:
            continue
        done = call_main(capsys.readouterr, *smaller(words))
        if done.status:
            refused.append(f"{line.text}\n{done.err or done.out}")
    assert not refused, "\n".join(refused)
