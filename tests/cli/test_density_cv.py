"""`orbiflow density cv`: what a user sees, and mistakes."""

from pathlib import Path
from typing import Any

import pytest

from density.cross_validation.small_tables import table_of
from refusals import names

HOW = "--space torus --unit radians --components mixture --against uniform --folds 2"
QUICK = HOW.split()


def test_twice(tmp_path: Path, orbiflow: Any) -> None:
    data, out = table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)]), tmp_path / "out"
    command = ("density", "cv", data, "--out", out, "--columns", "protein=group", *QUICK)
    first = orbiflow.done(*command)
    names(first.out, "folds/mixture-1-01", 40, 10, "mixture", "uniform", out / "index.html")
    done = {path: path.stat().st_mtime_ns for path in out.glob("folds/**/*")}
    second = orbiflow.done(*command)
    names(second.out, "mixture", "uniform")
    assert {path: path.stat().st_mtime_ns for path in out.glob("folds/**/*")} == done


@pytest.mark.parametrize(
    ("arguments", "about"),
    [
        (("--folds", "41"), "41 40"),
        (("--columns", "protein=group", "--folds", "11"), "11 10"),
        (("--columns", "chain=group"), "chain phi psi protein"),
        (("--columns", "phi,chi"), "chi"),
        (("--against", "mixture,magic"), "--against"),
        (("--against", "mixture"), "--components --against"),
        (("--components", "mixture,chains", "--against", "chains+mixture"), "mixture+chains"),
        (("--out", "diary"), "page.txt"),
    ],
)
def test_mistakes(arguments: tuple[str, ...], about: str, tmp_path, orbiflow, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    table_of(tmp_path, 40, protein=[f"p{k // 4}" for k in range(40)])
    (tmp_path / "diary").mkdir()
    (tmp_path / "diary" / "page.txt").touch()
    usual = dict(zip(QUICK[::2], QUICK[1::2], strict=True))
    others = [word for name in usual if name not in arguments for word in (name, usual[name])]
    outcome = orbiflow.refused("density", "cv", "angles.csv", *others, *arguments)
    assert outcome.err.startswith("error: ")
    names(outcome.err, *about.split())
    assert not (tmp_path / "cv").exists()
