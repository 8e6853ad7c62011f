"""Commands do not write over what they read, nor into a run's folder that the next run then refuses.

Nor do they write a file that its name's ending belies.
"""

import shutil
from pathlib import Path

import numpy as np
import pytest

from cli.conftest import Run, call_main
from refusals import names
from runtime.searches import boot_call
from small_searches import small_searches

QUICK = ("--components", "mixture", "--space", "torus", "--unit", "degrees")


@pytest.fixture(name="made", scope="module")
def made_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`data.csv`, its fit `m` and a marginal `psi`; `r`, what a search of `boot.json` left."""
    folder = tmp_path_factory.mktemp("made")
    angles = np.random.default_rng(0).normal([20.0, 60.0], 25.0, (40, 2))
    np.savetxt(folder / "data.csv", angles, "%.3f", ",", header="phi,psi", comments="")
    fit = ("density", "fit", folder / "data.csv", *QUICK, "--out", folder / "m")
    marginal = ("density", "marginal", "-m", folder / "m", "--columns", "psi")
    for words in (fit, (*marginal, "--out", folder / "psi")):
        assert call_main(lambda: ("", ""), *words).status == 0
    with small_searches():
        boot_call(folder, "IH4").run()
    (folder / "out").rename(folder / "r")
    return folder


def contents(folder: Path) -> dict[str, bytes | None]:
    """Of all files; folders, too."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in folder.rglob("*")
    }


@pytest.fixture(name="here")
def here_fixture(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    here = tmp_path / "here"
    shutil.copytree(made, here)
    (here / "link.csv").symlink_to("data.csv")
    shutil.copy(here / "m" / "density.safetensors", here / "model")
    (here / "linked").symlink_to("m", target_is_directory=True)
    monkeypatch.chdir(here)
    return here


def test_what_is_read_stays(here: Path, orbiflow: Run) -> None:
    shutil.copy(here / "r" / "IH4" / "tile.svg", here / "picture.svg")
    (here / "cv").mkdir()
    shutil.copy(here / "data.csv", here / "cv" / "rows.csv")
    before = contents(here)
    for words in (
        "density score data.csv -m m --out data.csv",
        "density score data.csv -m m --out ./m/../data.csv",
        "density score link.csv -m m --out data.csv",
        "density score data.csv -m m --out link.csv",
        *("density score data.csv -m model --out model", "density sample -m model --out ./model"),
        "density score data.csv -m m --out m/scores.csv",
        "density score data.csv -m m --out linked/scores.csv",
        "density score data.csv -m m --out m/density.csv",
        "density sample -m m/density.safetensors --out m/s.csv",
        *("density region -m m --out m/report.json", "density region -m m --out m/regions.json"),
        "density compare -m m -m psi -d data.csv --out data.csv",
        "density compare -m m -m psi -d data.csv --out psi/c.json",
        "density plot -m m --out m/plots.pdf",
        "density plot -m m --out m/pictures",
        "density fit psi/density.csv --space torus --unit degrees --out psi",
        "density fit psi/density.csv --space torus --unit degrees --out psi/again",
        "density cv cv/rows.csv --space torus --out cv",
        "density marginal -m m --columns psi --out m/psi",
        "density marginal -m m --columns psi --out m",
        "density marginal -m m/density.safetensors --columns psi --out linked",
        *("density conditional -m linked --given psi=60 --out m", "export r --out r/result.json"),
        *("export r/result.json --out r/result.json", "export r --out r/k.svg"),
        *("export r/result.json --out r/k.svg", "export r --out r/IH4/tiling.svg"),
        *("export r/IH4 --out r/IH4/k.svg", "animate r/IH4 --out r/IH4/tiling.svg"),
        *("art r --out r/overview.png", "art r --picture picture.svg --out picture.svg"),
        "animate r --out r/turtle.gif",
        "solid r --kind stamp --picture picture.svg --format stl --out picture.svg",
        "escherize r/IH4/tile.svg --classes IH4 --out r",
    ):
        out, done = Path(words.split()[-1]), orbiflow.refused(*words.split())
        assert any(part in done.err for part in (out.name, out.parent.name)), done.err
        assert contents(here) == before, words


def test_other_places_are_fine(here: Path, orbiflow: Run) -> None:
    (here / "copy").mkdir()
    (here / "copy" / "notes.txt").write_text("mine")
    shutil.copy(here / "r" / "result.json", here / "copy")
    for path in (here / "m").iterdir():
        shutil.copy(path, here / "copy")
    for words in (
        "density score data.csv -m m --out scores.csv",  # beside the data
        "density score psi/density.csv -m psi --out scores.csv",
        *("export r --out k.svg", "export r/IH4 --out k.svg"),
        "export copy/result.json --out copy/k.svg",  # no run's folder: it holds other files
        "density sample -m copy/density.safetensors --out copy/s.csv",
    ):
        orbiflow.done(*words.split())


def test_an_ending_of_another_format_is_refused(here: Path, orbiflow: Run) -> None:
    before = contents(here)
    for words in (
        "density sample -m m --out s.npy",
        "density sample -m linked --out density.safetensors",
        "density sample -m m --out x.geojson",
        "density score data.csv -m m --out s.XLSX",
        *("classes --out c.svg", "classes --out c.jpg"),
    ):
        done = orbiflow.refused(*words.split())
        endings = (".png",) if words.startswith("classes") else (".csv", ".tsv", ".txt", ".dat")
        names(done.err, "--out", *endings, words.split()[-1])
        assert not done.out
    assert contents(here) == before


def test_files_may_be_called_otherwise(here: Path, orbiflow: Run) -> None:
    for name in ("s", "s.txt", "s.tsv", "s.dat", "run-1.5"):
        orbiflow.done("density", "sample", "-m", "m", "-n", 2, "--out", name)
        assert (here / name).read_text().startswith("phi,psi\n")
    orbiflow.done("classes", "--classes", "IH4", "--out", "c")
    assert (here / "c").read_bytes().startswith(b"\x89PNG")
