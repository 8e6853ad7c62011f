"""Files of solids: parts, colours and copies in their places."""

import io
import zipfile
from pathlib import Path

import numpy as np
import pytest
from manifold3d import Manifold

from orbiflow.drawing import read_triangles, write_3mf, write_stl
from refusals import refused
from solids_read import read_3mf, read_stl

PARTS = {"block": Manifold.cube((1, 2, 3)), "ball": Manifold.sphere(1, 16)}
HALF_TURN = np.column_stack([np.diag([-1.0, -1.0, 1.0]), [10.0, 0.0, 2.5]])
AS_IT_IS = np.eye(3, 4)


def model(content: bytes) -> str:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        return archive.read("3D/3dmodel.model").decode()


def test_parts_are_in_both_files() -> None:
    volume = sum(body.volume() for body in PARTS.values())
    assert read_stl(write_stl(PARTS)).volume == pytest.approx(volume, rel=1e-5)
    objects = read_3mf(write_3mf(PARTS, "two of <them>"))
    assert [own.name for own in objects] == ["block", "ball"]
    assert sum(own.mesh.volume for own in objects) == pytest.approx(volume, rel=1e-5)
    assert "two of &lt;them&gt;" in model(write_3mf(PARTS, "two of <them>"))


def test_colours_of_parts() -> None:
    text = model(write_3mf(PARTS, colours={"ball": "#c0ffee"}))
    assert '<basematerials id="3">' in text
    assert '<base name="ball" displaycolor="#C0FFEE"/>' in text
    assert '<object id="2" type="model" name="ball" pid="3" pindex="0">' in text
    assert text.count("pid=") == 1
    assert "basematerials" not in model(write_3mf(PARTS))


def test_copies_of_a_part_repeat_no_mesh(tmp_path: Path) -> None:
    content = write_3mf(PARTS, places={"block": [AS_IT_IS, HALF_TURN]})
    text = model(content)
    assert text.count("<mesh>") == 2
    assert text.count('<item objectid="1" transform=') == 2
    assert text.count('<item objectid="2"/>') == 1
    (tmp_path / "a.3mf").write_bytes(content)
    first, second, ball = read_triangles(tmp_path / "a.3mf")
    assert second.reshape(-1, 3).min(axis=0) == pytest.approx([9, -2, 2.5])
    assert np.allclose(first @ HALF_TURN[:, :3].T + HALF_TURN[:, 3], second)
    assert ball.min() == pytest.approx(-1)
    with refused("(3, 4)"):
        write_3mf(PARTS, places={"block": [-AS_IT_IS]})
