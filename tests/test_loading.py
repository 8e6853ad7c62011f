"""`orbiflow.load`: what commands left, certified anew, and folders that cannot be loaded."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import orbiflow
from density.quick_fits import quick_fits_fixture  # noqa: F401
from orbiflow.density import DensityEstimator
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError, OutputError
from orbiflow.loading import LoadedRun
from orbiflow.runtime import find
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    EscherTile,
    ExportSettings,
    Tile,
    TileMap,
    export,
    read_document,
    read_result,
)
from orbiflow.tiles.result_file import tile_json
from refusals import refused
from small_searches import small_searches

TURTLE = Path(__file__).parents[1] / "examples" / "silhouettes" / "turtle.png"


@pytest.fixture(name="folders", scope="module")
def folders_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of two classes, and a density of angles in degrees."""
    root = tmp_path_factory.mktemp("loaded")
    search = {"out": root / "turtle", "classes": ["IH4", "IH6"], "effort": "fast", "workers": 1}
    with small_searches():
        find("escherize").call({"image": TURTLE, **search}).run()
    angles = np.degrees(np.random.default_rng(0).vonmises([0.5, -1.0], 6.0, (150, 2)))
    (root / "a.csv").write_text(
        "phi,psi\n" + "\n".join(f"{a:.3f},{b:.3f}" for a, b in angles) + "\n"
    )
    fit = {"space": "torus", "unit": "degrees", "components": ["kernels"], "seed": 3}
    find("density fit").call({"data": root / "a.csv", "out": root / "density", **fit}).run()
    return root


def test_a_density(folders: Path) -> None:
    found = orbiflow.load(folders / "density")
    assert isinstance(found, DensityEstimator)
    report = json.loads((folders / "density" / "report.json").read_text())
    data = np.loadtxt(folders / "a.csv", delimiter=",", skiprows=1)
    assert found.score(data) == pytest.approx(report["log_likelihood"]["natural"], abs=1e-9)
    assert found.report_.validation_nll == report["report"]["validation_nll"]
    assert found.report_.components[0].name == "kernels"
    assert found.report_.repeats is not None
    assert found.feature_names_in_.tolist() == ["phi", "psi"]
    assert (found.components, found.seed, found.n_features_in_) == (["kernels"], 3, 2)
    assert found.sample(3, random_state=1).shape == (3, 2)
    again = DensityEstimator(**found.get_params()).fit(data)
    assert again.score(data) == pytest.approx(found.score(data), abs=1e-9)
    alone = orbiflow.load(folders / "density" / "density.safetensors")
    assert isinstance(alone, DensityEstimator)


def test_flipped_bits_of_a_result_never_give_another_tile(tmp_path: Path) -> None:
    """What decides, polygon and group, is certified anew: a result.json may be edited by hand."""
    ring = [
        *([0, 0], [0.6, 0.13], [1.37, 0], [1.5, 0.7], [1.37, 1.21], [0.6, 1.34], [0, 1.21]),
        [0.13, 0.7],
    ]
    tile = Tile(np.array(ring), wallpaper_group("p1", np.diag([1.37, 1.21])))
    folder = orbiflow.save(EscherTile(tile), tmp_path / "saved")
    whole = (folder / "result.json").read_bytes()
    loaded = 0
    for bit in np.random.default_rng(0).integers(0, 8 * len(whole), 300).tolist():
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        (folder / "result.json").write_bytes(data)
        try:
            found = orbiflow.load(folder)
        except OrbiflowError:
            continue
        loaded += 1
        assert isinstance(found, LoadedRun)
        assert np.abs(found.best.tile.polygon - ring).max() < 1e-6
        assert np.allclose(found.best.tile.group.lattice, tile.group.lattice)
    assert 0 < loaded < 200


class Frame:
    """What an estimator takes for a data frame."""

    def __init__(self, values: Any, columns: list[str]) -> None:
        self.values, self.columns = np.asarray(values), columns

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Any:
        return self.values if dtype is None else self.values.astype(dtype)


@pytest.mark.parametrize(
    ("name", "columns"),
    [("fit", ["phi", "psi"]), ("fit", None), ("fit.safetensors", ["phi", "psi"])],
)
def test_an_estimator_is_saved_with_its_names(
    tmp_path: Path, name: str, columns: list[str] | None
) -> None:
    angles = np.degrees(np.random.default_rng(0).vonmises([0.5, -1.0], 6.0, (60, 2)))
    data = angles if columns is None else Frame(angles, columns)
    fit = DensityEstimator("torus", unit="degrees", components="kernels", seed=4).fit(data)
    path = orbiflow.save(fit, tmp_path / name)
    assert path == tmp_path / name
    found = orbiflow.load(path)
    assert isinstance(found, DensityEstimator)
    assert np.array_equal(found.score_samples(angles), fit.score_samples(angles))
    assert list(getattr(found, "feature_names_in_", [])) == (columns or [])
    assert found.unit == "degrees"
    if path.is_dir():
        assert (found.components, found.seed) == ("kernels", 4)
        assert found.report_.validation_nll == fit.report_.validation_nll
        orbiflow.save(found, path)  # in its own place
    again = orbiflow.load(orbiflow.save(found, tmp_path / "again"))
    assert isinstance(again, DensityEstimator)
    assert np.array_equal(again.score_samples(angles), fit.score_samples(angles))
    if columns:
        part = orbiflow.load(orbiflow.save(fit.marginal("psi"), tmp_path / "part"))
        assert isinstance(part, DensityEstimator)
        assert part.feature_names_in_.tolist() == ["psi"]


def test_estimators_that_cannot_be_saved(tmp_path: Path) -> None:
    with refused("estimator", "fit"):
        orbiflow.save(DensityEstimator(), tmp_path / "none")
    (tmp_path / "letter.txt").write_text("mine")
    fit = DensityEstimator(components="kernels").fit(np.random.default_rng(0).normal(size=(40, 2)))
    with refused("letter.txt", kind=OutputError):
        orbiflow.save(fit, tmp_path)


def test_a_run_and_its_tiles(folders: Path, tmp_path: Path) -> None:
    found = orbiflow.load(folders / "turtle")
    assert isinstance(found, LoadedRun)
    assert len(found) == 2
    assert [tile.rank for tile in found] == [1, 2]
    tile = orbiflow.load(folders / "turtle" / "IH6")
    assert isinstance(tile, EscherTile)
    assert tile.isohedral_class == "IH6"
    assert tile.certificate.valid
    _, document = read_document(folders / "turtle")
    entry = next(entry for entry in document["tiles"] if entry["class"] == "IH6")
    assert np.array_equal(tile.tile.polygon, np.array(entry["polygon"])[:-1])
    assert json.loads(json.dumps(tile_json(tile))) == entry
    assert np.array_equal(tile.tile.polygon, found["IH6"].tile.polygon)
    assert found[found["IH6"].rank or 0].name == found["IH6"].name
    assert tile.bending is not None
    assert tile.frame is not None
    moved = tile.bending.forward(tile.frame.to_normal([[90.0, 100.0]]))
    assert moved.shape == (1, 2)
    assert found.best.tile.group.order > 1
    export(found.best, tmp_path / "cut.svg", ExportSettings(purpose="laser", tile_size=40))
    assert (tmp_path / "cut.svg").stat().st_size > 500
    with refused("IH1", "IH4", "IH6"):
        _ = found["IH1"]
    by_file = orbiflow.load(folders / "turtle" / "result.json")
    assert isinstance(by_file, LoadedRun)


def test_a_tile_that_is_saved_is_loaded_the_same(folders: Path, tmp_path: Path) -> None:
    found = orbiflow.load(folders / "turtle" / "IH6")
    assert isinstance(found, EscherTile)
    again = orbiflow.load(orbiflow.save(found, tmp_path / "saved"))
    assert isinstance(again, LoadedRun)
    assert tile_json(again.best) == tile_json(found)
    assert again.best.name == found.name
    points = np.array([[90.0, 100.0], [120.0, 80.0]])
    assert np.array_equal(again.best.forward(points), found.forward(points))
    orbiflow.save(again, tmp_path / "saved")
    orbiflow.save([found.changed(map_source=None)], tmp_path / "saved")
    bare = read_result(tmp_path / "saved")
    assert bare.map is None
    plain = EscherTile(bare.tile)
    assert np.isnan(plain.score)
    orbiflow.save(plain, tmp_path / "plain")
    assert np.isnan(read_result(tmp_path / "plain").likeness.metrics.iou)
    with refused("turtle", kind=OutputError):
        orbiflow.save(found, folders / "turtle")


def test_a_tile_that_does_not_tile(folders: Path, tmp_path: Path) -> None:
    folder = tmp_path / "turtle"
    shutil.copytree(folders / "turtle", folder)
    document = json.loads((folder / "result.json").read_text())
    name = document["tiles"][0]["class"]
    document["tiles"][0]["polygon"][5][0] += 5
    (folder / "result.json").write_text(json.dumps(document))
    for path in (folder, folder / name):
        with refused("uncertified=True", kind=CertificationError):
            orbiflow.load(path)
    found = orbiflow.load(folder, uncertified=True)
    assert isinstance(found, LoadedRun)
    assert not found.best.certificate.valid
    (folder / name / "model.safetensors").unlink()
    bare = orbiflow.load(folder, uncertified=True)
    assert isinstance(bare, LoadedRun)
    assert bare.best.map is None
    assert bare.best.bending is None


def test_folders_that_cannot_be_loaded(folders: Path, tmp_path: Path) -> None:
    def refuse(path: Any, *about: object) -> None:
        with refused(*about):
            orbiflow.load(path)

    refuse(tmp_path, "density.safetensors", "result.json")
    refuse(tmp_path / "none", tmp_path / "none")
    refuse(folders / "a.csv", folders / "a.csv")
    refuse(3, 3)
    both = tmp_path / "both"
    shutil.copytree(folders / "density", both)
    shutil.copy(folders / "turtle" / "result.json", both)
    refuse(both, "density.safetensors", "result.json")
    assert isinstance(orbiflow.load(both / "density.safetensors"), DensityEstimator)
    alone = tmp_path / "IH4"
    shutil.copytree(folders / "turtle" / "IH4", alone)
    assert isinstance(orbiflow.load(alone), TileMap)
    damaged = tmp_path / "damaged"
    shutil.copytree(folders / "density", damaged)
    for text in ("{", "[]", '{"report": 3, "settings": {}}', '{"report": {}, "settings": 1}'):
        (damaged / "report.json").write_text(text)
        with refused("report.json", kind=InputFileError):
            orbiflow.load(damaged)
    (damaged / "report.json").unlink()
    found = orbiflow.load(damaged)
    assert isinstance(found, DensityEstimator)
    assert not hasattr(found, "report_")
    content = (damaged / "density.safetensors").read_bytes()
    (damaged / "density.safetensors").write_bytes(content[: len(content) // 2])
    with refused(damaged, kind=InputFileError):
        orbiflow.load(damaged)
    empty = tmp_path / "empty"
    empty.mkdir()
    for text in ("{", "{}", '{"tiles": []}', '{"tiles": [1]}', '{"tiles": {"a": 1}}'):
        (empty / "result.json").write_text(text)
        with refused("result.json", kind=InputFileError):
            orbiflow.load(empty)
