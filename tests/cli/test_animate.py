"""`orbiflow animate`: options reach the job, mistakes name them."""

from __future__ import annotations

from pathlib import Path

import pytest

from orbiflow.runtime import find
from refusals import names
from runtime.searches import boot_call
from small_searches import small_searches


@pytest.fixture(scope="module", name="folder")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    with small_searches():
        boot_call(folder, "IH4").run()
    return folder / "out"


def test_an_svg_of_a_bending_silhouette(folder: Path, tmp_path: Path, orbiflow) -> None:
    out = tmp_path / "boot.svg"
    options = ["--kind", "bend", "--tile", "ih4", "--seconds", 3, "--area", "200x134px"]
    outcome = orbiflow("animate", folder, "--out", out, *options, "--palette", "ochre")
    assert (outcome.status, outcome.err) == (0, "")
    names(outcome.out, out, "IH4", 200, 134)
    assert 'dur="3s"' in out.read_text()
    # the same as the operation's own
    again = tmp_path / "again.svg"
    given = {"kind": "bend", "seconds": 3.0, "area": "200x134px", "palette": "ochre"}
    find("animate").call({"result": folder, "out": again, **given}).run()
    assert again.read_text() == out.read_text()
