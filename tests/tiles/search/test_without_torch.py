"""The search for likeness needs no torch: neither where it is asked for nor in its workers."""

from __future__ import annotations

import subprocess
import sys

SEARCH = """
import sys
from orbiflow.tiles import EscherizeSettings, LikenessSearch, Target, escherize
from orbiflow.tiles.search import escherizing

boot = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
few = LikenessSearch(placements=10, held=3, starts=2, finalists=1, rounds=2)
inside = escherizing._outcome

def work_on(*arguments):
    outcome = inside(*arguments)
    assert "torch" not in sys.modules
    return outcome

escherizing._outcome = work_on
if __name__ == "__main__":
    for workers in (1, 2):
        settings = EscherizeSettings(classes=("IH4", "IH6"), workers=workers)
        found = escherize(boot, settings, method=few)
        assert len(found.tiles) == 2 and not found.failures, found.failures
        assert all(tile.certificate.valid for tile in found.tiles)
        out = f"{sys.argv[1]}{workers}"
        found.tiles[0].save(out)
        assert found.tiles[0].load(out).bending is not None
    print([name for name in sys.modules if name.split(".")[0] == "torch"])
"""


def test_a_search_for_likeness_imports_no_torch(tmp_path) -> None:
    file = tmp_path / "search.py"
    file.write_text(SEARCH)
    done = subprocess.run(
        [sys.executable, str(file), str(tmp_path / "out")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip() == "[]"


COMMAND = """
import json, sys
from pathlib import Path
from orbiflow.cli.app import run

boot = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]]
Path("boot.json").write_text(json.dumps(boot))
words = ["escherize", "boot.json", "--effort", "fast", "--classes", "IH7", "--workers", "1"]
assert run(words) == 0
assert "torch" not in sys.modules
"""


def test_the_command_imports_none_either(tmp_path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", COMMAND], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "IH7" / "model.safetensors").exists()
