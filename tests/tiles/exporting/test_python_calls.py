"""What Python calls take: result folders, tiles in memory; and what decides a file's format."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from artworks import art_settings, squirrel, write_run
from orbiflow.errors import CertificationError, InputFileError
from orbiflow.tiles import (
    ArtSettings,
    ClassFailure,
    EscherTile,
    ExportSettings,
    Fidelity,
    LikenessSearch,
    SearchResult,
    Tile,
    art,
    artwork,
    escherize_class,
    export,
    read_result,
    with_map,
)
from orbiflow.tiles import write_run as write_folder
from outlines import animal
from refusals import refused
from small_searches import FEW

SMALL = art_settings(area="90x60px", tile_size="40px")
BARE = LikenessSearch(**FEW)


@pytest.fixture(scope="module")
def found() -> EscherTile:
    result = escherize_class(animal("squirrel.dat"), "IH4", BARE)
    assert isinstance(result, EscherTile)
    return result


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, found: EscherTile) -> Path:
    target = animal("squirrel.dat")
    out = tmp_path_factory.mktemp("runs") / "squirrel"
    write_folder(SearchResult(target, [found], method=BARE), out)
    return out


def drawing(tile: Any, out: Path, settings: ArtSettings, **options: Any) -> Path:
    """The file that `art` writes."""
    assert art(tile, out, settings, **options).tiles > 0
    return out


def sources(folder: Path, found: EscherTile) -> list[Any]:
    return [folder, str(folder), folder / "result.json", read_result(folder), found]


def test_a_run_without_a_tile_says_why_and_replaces_none(tmp_path: Path, found: EscherTile) -> None:
    target, out = animal("squirrel.dat"), tmp_path / "out"
    nothing = SearchResult(target, failures=[ClassFailure("IH4", "it folds")])
    assert write_folder(nothing, out) == [out / "result.json"]
    assert json.loads((out / "result.json").read_text())["failed"][0]["reason"] == "it folds"
    assert len(write_folder(SearchResult(target, [found]), out)) > 5
    assert write_folder(nothing, out) == []
    assert read_result(out).isohedral_class == "IH4"


def test_everything_that_holds_a_tile_is_exported_alike(tmp_path, folder, found) -> None:
    settings = ExportSettings(tile_size=30, area=(90, 60))
    files = [
        export(source, tmp_path / f"{k}.json", settings).files[0]
        for k, source in enumerate(sources(folder, found))
    ]
    first, *others = (json.loads(file.read_text())["tiles"] for file in files)
    assert first
    assert all(other == first for other in others)


def test_a_tile_without_a_map_needs_the_target_for_pictures(tmp_path: Path) -> None:
    target, tile = animal("squirrel.dat"), squirrel("IH4").tile
    plain = Tile(tile.polygon, tile.group, "IH4")
    assert drawing(plain, tmp_path / "plain.svg", SMALL).is_file()
    seen = art_settings(area="90x60px", eyes=((210.0, 190.0),))
    with refused("IH4", "target"):
        art(plain, tmp_path / "eye.png", seen)
    assert drawing(with_map(plain, target), tmp_path / "eye.png", seen).is_file()
    assert with_map(plain, target).notes


def test_a_picture_goes_through_the_map(tmp_path: Path, found: EscherTile) -> None:
    covered = found.covered
    size = tuple(int(side) for side in np.rint(covered.high - covered.low))
    painted = tmp_path / "painted.png"
    Image.new("RGB", (size[0], size[1]), "#ff0000").save(painted)
    settings = art_settings(area="90x60px", tile_size="40px", outline=0.0)
    out = drawing(found, tmp_path / "red.png", settings, picture=painted)
    pixels = np.asarray(Image.open(out).convert("RGB"))
    assert (pixels == (255, 0, 0)).all()


def test_mistakes_are_said_before_anything_is_written(tmp_path: Path, found: EscherTile) -> None:
    out = tmp_path / "a.gif"
    with refused("out", "a.gif", ".html"):
        art(found, out)
    with refused("none", kind=InputFileError):
        export(tmp_path / "none", tmp_path / "a.svg")
    with refused("none.png", kind=InputFileError):
        art(found, tmp_path / "a.png", SMALL, picture=tmp_path / "none.png")
    bad = Tile(1.01 * found.tile.polygon, found.tile.group, "IH4")
    with pytest.raises(CertificationError):
        art(bad, tmp_path / "a.png", SMALL)
    assert not list(tmp_path.iterdir())
    assert drawing(bad, tmp_path / "a.png", SMALL, force=True).is_file()


def test_a_notebook_shows_exports_and_artwork(tmp_path: Path, found: EscherTile) -> None:
    done = export(found, tmp_path / "a.svg", ExportSettings(tile_size=30, area=(90, 60)))
    assert Image.open(io.BytesIO(done._repr_png_())).size == (600, 400)
    assert Image.open(io.BytesIO(artwork(found, SMALL)._repr_png_())).size == (90, 60)


def test_measures_are_read_whole_or_not_at_all(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", "IH5", model=False)
    document = json.loads((run / "result.json").read_text("utf-8"))
    (entry,) = document["tiles"]
    kept = {"pieces": [0.1, 0.2], "stretched": 0.2, "thickness": 0.1, "blunted": 3.0}
    kept |= {"moved": 0.01, "merged": 0.05, "cost": 0.3, "length": 6.0}
    entry["metrics"] = {"fidelity": kept}
    (run / "result.json").write_text(json.dumps(document))
    assert read_result(run).likeness.fidelity == Fidelity(
        (0.1, 0.2), 0.2, 0.1, 3.0, 0.01, 0.05, 0.3, 6.0
    )
    del kept["length"]
    (run / "result.json").write_text(json.dumps(document))
    with refused("tile 1", "length", kind=InputFileError):
        read_result(run)


@pytest.mark.parametrize("version", [0, 1, 3, None, "2"])
def test_results_of_other_layouts_are_refused(tmp_path: Path, version: object) -> None:
    run = write_run(tmp_path / "run", "IH5", model=False)
    document = json.loads((run / "result.json").read_text("utf-8"))
    (run / "result.json").write_text(json.dumps({**document, "schema_version": version}))
    with refused("schema_version", repr(version), kind=InputFileError):
        read_result(run)
