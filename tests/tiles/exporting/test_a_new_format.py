"""A new format of files is one function and its entry in the table of writers: see CONTRIBUTING.md."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from exported import tile_of
from orbiflow.settings import fields_of
from orbiflow.tiles import ExportSettings, Scene, export
from orbiflow.tiles.write import WRITERS


def write_gcode(scene: Scene, *, tolerance: float = 0.1) -> str:
    """Return the scene as moves of a pen, in mm with y up."""
    lines = ["G21 ; mm", f"; {scene.title}"]
    for curve in (curve for layer in scene.layers for curve in scene.curves(layer)):
        points = curve.flattened(tolerance).tolist()
        for k, (x, y) in enumerate(points + points[: int(curve.closed)]):
            lines.append(f"G{int(k > 0)} X{x:.3f} Y{scene.height - y:.3f}")
    return "\n".join([*lines, ""])


@pytest.fixture(autouse=True)
def _known_format(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setitem(WRITERS, "gcode", f"{__name__}:write_gcode")
    fields_of.cache_clear()
    yield
    fields_of.cache_clear()


def test_the_ending_is_known_and_the_file_is_written(tmp_path: Path) -> None:
    settings = ExportSettings(purpose="plotter", tile_size=60, area=(200, 150))
    done = export(tile_of("IH4"), tmp_path / "pen.gcode", settings)
    text = done.files[0].read_text().splitlines()
    assert text[0] == "G21 ; mm"
    assert sum(line.startswith("G0 ") for line in text) < sum(
        line.startswith("G1 ") for line in text
    )
    assert ExportSettings(format="gcode").file_format == "gcode"
