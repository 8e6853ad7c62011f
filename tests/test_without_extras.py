"""All that tiles need works without torch, matplotlib and the other packages of extras."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from orbiflow.settings.extras import EXTRAS
from refusals import names

HERE = Path(__file__).parent
TURTLE = HERE.parent / "examples" / "silhouettes" / "turtle.png"
ANGLES = HERE.parent / "examples" / "density" / "backbone.csv"
TORUS = "--space torus --columns phi,psi --unit degrees"
BASE_HAS = ("starlette", "uvicorn")
"""Packages of the studio, which is installed with the base by `make demo`."""


@pytest.fixture(scope="module", name="bare")
def bare_fixture(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Return an environment in which packages of extras cannot be imported, in child processes too."""
    absent = tmp_path_factory.mktemp("absent")
    for name in (*EXTRAS, "skimage", "sklearn"):
        if name not in BASE_HAS:
            text = f'raise ModuleNotFoundError("No module named {name!r}", name="{name}")\n'
            (absent / f"{name}.py").write_text(text)
    paths = [str(absent), str(HERE), os.environ.get("PYTHONPATH", "")]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def run(words: list[str], bare: dict[str, str], folder: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=bare, capture_output=True, text=True, check=False
    )


JOBS = """
import runtime.small_process
from orbiflow.cli.app import run
from sys import argv, modules

for words in (
    f"escherize {argv[1]} --effort fast --classes IH4 --figures --out run",
    *(f"export run --area 90x60mm --out cut.{form}" for form in ("svg", "pdf", "png", "dxf", "json")),
    "export run --for laser --cut jigsaw --area 90x60mm --out pieces.svg",
    "art run --engrave --area 150x100px --out art.png",
    f"art run --picture {argv[1]} --area 150x100px --out picture.svg",
    "animate run --area 100x66px --seconds 0.5 --out run.gif",
    "solid run --out tile.stl",
    "solid run --out cutter.3mf",
    f"batch {argv[2]} --effort fast --classes IH4 --out many",
):
    assert run(words.split()) == 0, words
assert not {"torch", "matplotlib"} & modules.keys()
"""


def test_a_tile_from_the_picture_to_all_files(bare: dict[str, str], tmp_path: Path) -> None:
    file = tmp_path / "jobs.py"
    file.write_text(JOBS)
    many = tmp_path / "animals"
    many.mkdir()
    (many / TURTLE.name).write_bytes(TURTLE.read_bytes())
    done = run([str(file), str(TURTLE), many.name], bare, tmp_path)
    assert done.returncode == 0, done.stderr
    made = ["run/overview.png", "run/index.html", "run/IH4/tiling.pdf", "cut.pdf", "cut.png"]
    made += ["cut.dxf", "art.png", "picture.svg", "run.gif", "tile.stl", "many/index.html"]
    assert all((tmp_path / name).stat().st_size for name in made)


STUDIO = """
import runtime.small_process
import sys
from pathlib import Path
from orbiflow import tiles
from studio.served import SQUARE, join_tasks, studio

every = tiles.EscherizeSettings
tiles.EscherizeSettings = lambda **given: every(**given, classes=("IH4",))

with studio(Path("home")) as client:
    project = client.post("/api/projects", json={"name": "House"}).json()["id"]
    address = f"/api/projects/{project}"
    answer = client.put(f"{address}/input?name=house.json", content=SQUARE)
    assert answer.status_code == 200, answer.text
    join_tasks()
    search = {"operation": "search", "settings": {"effort": "fast"}}
    answer = client.post(f"{address}/tasks", json=search)
    assert answer.status_code == 200, answer.text
    join_tasks()
    own = client.get(address).json()
    assert own["tiles"], own
    tile = own["tiles"][0]["id"]
    for operation in ("export", "art", "solid"):
        take = {"operation": operation, "settings": {"tile": tile}}
        task = client.post(f"{address}/tasks", json=take)
        assert task.status_code == 200, task.text
        join_tasks()
        (made,) = client.get(f"{address}").json()["tasks"][:1]
        assert made["state"] == "done", made
    answer = client.post("/api/projects", json={"kind": "density"})
    assert answer.status_code == 422 and "pip install 'orbiflow[density]'" in answer.text, answer.text
assert not {"torch", "matplotlib"} & sys.modules.keys()
"""


def test_the_studio_from_a_picture_to_files(bare: dict[str, str], tmp_path: Path) -> None:
    file = tmp_path / "page.py"
    file.write_text(STUDIO)
    done = run([str(file)], bare, tmp_path)
    assert done.returncode == 0, done.stderr


MISSING = """
import sys
import orbiflow
from orbiflow.cli.app import run
from orbiflow.settings import MissingExtraError
from orbiflow.symmetry import space_group

for words in sys.argv[1:]:
    assert run(words.split()) == 2, words
for call in (lambda: orbiflow.DensityEstimator, lambda: space_group("P 21")):
    try:
        call()
    except MissingExtraError as error:
        print(error.who, error.package, error.extra, sep=", ")
        assert f"pip install 'orbiflow[{error.extra}]'" in str(error)
"""


def test_what_is_missing_is_said_with_its_cure(bare: dict[str, str], tmp_path: Path) -> None:
    fit, overlap = f"density fit {ANGLES} {TORUS}", f"escherize {TURTLE} --objective overlap"
    done = run(["-c", MISSING, fit, overlap], bare, tmp_path)
    assert done.returncode == 0, done.stderr
    one, other = done.stderr.splitlines()
    names(one, "orbiflow density fit", "pandas", "pip install 'orbiflow[density]'")
    names(other, "orbiflow escherize", "torch", "pip install 'orbiflow[flows]'")
    estimator, groups = done.stdout.splitlines()[-2:]
    assert estimator == "orbiflow.DensityEstimator, torch, density"
    assert groups.endswith("gemmi, crystals")
    assert list(tmp_path.iterdir()) == []
