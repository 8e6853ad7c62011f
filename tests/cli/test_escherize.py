"""Real runs, with few iterations."""

import io
import json
import shutil
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
import torch
from PIL import Image, ImageDraw
from rich.console import Console

from cli.conftest import call_main
from orbiflow import __version__
from orbiflow.cli import terminal
from orbiflow.runtime import Table
from orbiflow.tiles import (
    CLASSES,
    ClassFinalists,
    Rating,
    Target,
    TileModel,
    silhouette,
    write_tile_folder,
)
from orbiflow.tiles.flowing import overlap_search
from orbiflow.tiles.run_folder import writing
from orbiflow.tiles.run_folder.files import FIGURE_FILES
from orbiflow.tiles.search import candidates
from orbiflow.tiles.search.finished_tiles import best_tiles
from refusals import names
from small_searches import small_searches

FILES = {"tile.svg", "tiling.svg", "tiling.png", "overlay.png", "model.safetensors"}
SHEETS = ("index.html", "overview.png", "read.png", "result.json")
FEW = ["--method", "occupancy", "--iterations", 8, "--turns", 1, "--max-frequency", 2]

# a shape in pixels with nothing symmetric about it
BOOT = [(60, 20), (210, 20), (230, 80), (170, 95), (160, 190), (100, 145), (45, 80)]


def crossed() -> TileModel:
    """A candidate whose template crosses itself."""
    model = TileModel(CLASSES["IH21"], torch.zeros(1), max_frequency=1)
    model.shape.data += 2.0
    return model


@pytest.fixture(scope="module", name="folder")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Of a run on a picture of the boot, two classes, one named in small letters."""
    folder = tmp_path_factory.mktemp("run")
    image = Image.new("L", (300, 220), 255)
    ImageDraw.Draw(image).polygon(BOOT, fill=0)
    image.save(folder / "boot.png")
    words = ("escherize", folder / "boot.png", "--out", folder / "new" / "out")
    said = io.StringIO()
    with redirect_stdout(said), small_searches():
        assert call_main(lambda: ("", ""), *words, "--classes", "IH4,ih6", *FEW).status == 0
    names(said.getvalue(), "IH4", "IH6")
    return folder


@pytest.fixture(scope="module", name="document")
def document_fixture(folder: Path) -> dict[str, Any]:
    return json.loads((folder / "new" / "out" / "result.json").read_text(encoding="utf-8"))


def test_all_files_are_there(folder: Path) -> None:
    out = folder / "new" / "out"
    assert {p.name for p in out.iterdir()} == {"IH4", "IH6", *SHEETS}
    for name in ("IH4", "IH6"):
        assert {p.name for p in (out / name).iterdir()} == FILES


def test_tiles_lie_upright_on_the_silhouette(folder: Path, document: dict[str, Any]) -> None:
    # pixel centres are at halves, and drawn polygons include their border
    drawn = shapely.Polygon(np.array(BOOT) + 0.5).buffer(0.5)
    goal = shapely.Polygon(Target.read(folder / "boot.png").outline)
    assert goal.symmetric_difference(drawn).area < 0.02 * drawn.area
    for entry in document["tiles"]:
        tile = shapely.Polygon(entry["polygon"])
        iou = tile.intersection(goal).area / tile.union(goal).area
        assert iou == pytest.approx(entry["metrics"]["iou"], abs=1e-9)
        own = tile.intersection(drawn).area / tile.union(drawn).area
        assert own == pytest.approx(iou, abs=0.02)
        assert own > 0.6
        flipped = shapely.Polygon([(x, 210 - y) for x, y in entry["polygon"]])
        assert flipped.intersection(drawn).area / flipped.union(drawn).area < own


@pytest.mark.usefixtures("small_searches")
def test_a_run_on_a_polygon_with_y_up(tmp_path: Path, orbiflow, monkeypatch) -> None:
    monkeypatch.setattr("orbiflow.drawing.canvas._SAMPLES", 40)
    monkeypatch.setattr("orbiflow.drawing.canvas._STEPS", 4)
    path = tmp_path / "boot.json"
    path.write_text(json.dumps(BOOT))
    options = ["--classes", "28", "--figures", *FEW]
    outcome = orbiflow.done("escherize", path, "-o", tmp_path / "o", *options)
    document = json.loads((tmp_path / "o" / "result.json").read_text(encoding="utf-8"))
    assert document["input"]["y_down"] is False
    (entry,) = document["tiles"]
    tile, goal = shapely.Polygon(entry["polygon"]), shapely.Polygon(BOOT)
    iou = tile.intersection(goal).area / tile.union(goal).area
    assert iou == pytest.approx(entry["metrics"]["iou"], abs=1e-9)
    assert {p.name for p in (tmp_path / "o" / "IH28").iterdir()} == FILES | set(FIGURE_FILES)
    with Image.open(tmp_path / "o" / "IH28" / "field.png") as image:
        image.load()
        assert min(image.size) >= 400
    # a run without figures takes the place of one with them
    again = orbiflow.done("escherize", path, "-o", tmp_path / "o", *options[:2], "--verbose", *FEW)
    assert "★" in outcome.out
    assert entry["arrangement"] == "four around a point"
    assert entry["arrangement"] in outcome.out
    assert entry["rating"]["word"] in outcome.out
    assert f"{entry['score']:.3f}" in again.out
    assert {p.name for p in (tmp_path / "o" / "IH28").iterdir()} == FILES


def test_the_version_and_stars_in_any_encoding(orbiflow, monkeypatch) -> None:
    outcome = orbiflow("--version")
    assert (outcome.status, outcome.out, outcome.err) == (0, f"orbiflow {__version__}\n", "")
    for encoding, stars in (("utf-8", "★★★½"), ("cp1252", "*** 1/2"), ("ascii", "*** 1/2")):
        file = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
        monkeypatch.setattr(terminal, "output", Console(file=file, width=80))
        terminal.Terminal()(Table("Tiles", ("class", "stars"), (("IH4", str(Rating(3.5))),)))
        file.seek(0)
        assert stars in file.read()


def test_no_tile_is_status_one(folder: Path, tmp_path, orbiflow, monkeypatch) -> None:
    path, out = tmp_path / "boot.json", tmp_path / "o"
    path.write_text(json.dumps(BOOT))
    monkeypatch.setattr(overlap_search, "fit_occupancy", lambda *_, **__: crossed())
    for room in (silhouette, writing):
        monkeypatch.setattr(room, "doubts", lambda _: ["the silhouette is odd"])
    search = ("escherize", path, "-o", out, "--classes", "IH21", *FEW)
    for _ in range(2):  # the second time there is a run without a tile to replace
        outcome = orbiflow(*search)
        assert outcome.status == 1
        names(outcome.err, "IH21", out / "result.json")
        assert outcome.err.count("the silhouette is odd") == 2  # at the start and at the end
    assert {p.name for p in out.iterdir()} == {"read.png", "result.json"}
    document = json.loads((out / "result.json").read_text(encoding="utf-8"))
    assert document["tiles"] == []
    assert [entry["class"] for entry in document["failed"]] == ["IH21"]
    earlier = shutil.copytree(folder / "new" / "out", tmp_path / "earlier")
    before = (earlier / "result.json").read_bytes()
    outcome = orbiflow(*search[:3], earlier, *search[4:])
    assert outcome.status == 1
    names(outcome.err, earlier)
    assert (earlier / "result.json").read_bytes() == before


def test_a_forced_tile_is_marked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(candidates, "TOLERANCES", (5e-3,))  # its thousands of vertices take long
    target = Target.from_polygon(BOOT, source="some/boot.json")
    result = best_tiles(target, ClassFinalists(crossed(), 1, 0, 1), force=True)[0]
    written = write_tile_folder(result, [target], tmp_path / "IH21")
    assert {path.name for path in written} == FILES
    for name in ("tile.svg", "tiling.svg"):
        assert "boot.json, IH21 (p6), NOT CERTIFIED" in (tmp_path / "IH21" / name).read_text()
