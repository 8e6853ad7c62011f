"""What the studio remembers of a silhouette."""

import json
from pathlib import Path

import numpy as np
import pytest
import shapely
from PIL import Image, ImageDraw

from orbiflow.studio.silhouette_file import load_target, read_input, silhouette_file
from orbiflow.tiles import ReadingSettings, Target
from orbiflow.tiles.silhouette import left_out_share


def test_the_studio_remembers_what_was_seen(tmp_path: Path) -> None:
    (tmp_path / "input.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100">'
        '<path d="M10 60 60 60 60 90 10 90Z M10 20 60 20 60 40 10 40Z"/></svg>'
    )
    ring = shapely.Polygon(Target.read(tmp_path / "input.svg").outline)
    read_input(tmp_path, "a.svg", ReadingSettings())
    again = load_target(tmp_path)
    assert np.isclose(shapely.Polygon(again.outline).area, ring.area)
    assert left_out_share(again) == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize(("ink", "is_told"), [((16, 16, 16), False), ((60, 140, 90), True)])
def test_the_studio_begins_without_the_picture_of_a_black_icon(
    tmp_path: Path, ink: tuple[int, int, int], is_told: bool
) -> None:
    image = Image.new("RGB", (300, 220), "white")
    pen = ImageDraw.Draw(image)
    pen.ellipse((40, 30, 260, 190), fill=ink)
    pen.ellipse((90, 60, 112, 82), fill="white")
    image.save(tmp_path / "input.png")
    read_input(tmp_path, "icon.png", ReadingSettings())
    shown = json.loads(silhouette_file(tmp_path).read_text())["shown"]
    assert shown["told_apart"] == is_told
    assert shown["coloured"]
