"""Pictures and files of solids: what is in front is seen; parts and copies in their places."""

import io
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
from manifold3d import Manifold

from orbiflow.drawing import (
    ShadedPart,
    SolidView,
    draw_solids,
    nearest_triangles,
    read_triangles,
    solid_picture,
    write_3mf,
    write_stl,
)
from orbiflow.drawing.solid_pictures import crease_normals
from solids_read import CORE, read_3mf, read_stl

FROM_THE_TOP = SolidView((0.0, 0.0, 1.0), (0.0, 1.0, 0.0))


def triangles(body: Manifold) -> tuple[Any, Any]:
    mesh = body.to_mesh64()
    return np.array(mesh.vert_properties)[:, :3], np.array(mesh.tri_verts).astype(np.int64)


def corners(body: Manifold) -> Any:
    points, faces = triangles(body)
    return points[faces]


def slab(size: float, low: float, high: float) -> Any:
    return corners(Manifold.cube((size, size, high - low)).translate((-size / 2, -size / 2, low)))


def test_what_is_in_front_is_seen() -> None:
    below, above, hidden = slab(30, 0, 3), slab(12, 3, 6), slab(6, 1, 2)
    picture = np.asarray(solid_picture([below, above, hidden], (160, 120)), float)
    low, top = picture[90, 80], picture[50, 80]
    assert np.ptp(low) > 60  # of the colours of a palette
    assert np.abs(low / low.sum() - top / top.sum()).max() > 0.1
    assert picture[2, 2].tolist() == [255] * 3
    lone = np.asarray(solid_picture([below, above], (160, 120)), float)
    assert np.array_equal(lone, picture)


def test_the_nearest_triangle_of_each_pixel() -> None:
    """Against the triangles asked one by one at each pixel's middle."""
    rng = np.random.default_rng(3)
    several = rng.uniform(-5, 35, (30, 3, 3))
    seen = nearest_triangles(several, 32, 24)
    places = np.stack(np.meshgrid(np.arange(32) + 0.5, np.arange(24) + 0.5), axis=-1)
    ones = np.concatenate([several[..., :2], np.ones((30, 3, 1))], axis=2)
    asked = np.concatenate([places, np.ones((24, 32, 1))], axis=2)
    shares = np.einsum("yxj,njk->nyxk", asked, np.linalg.inv(ones))
    depth = np.where(
        (shares >= 0).all(axis=3), np.einsum("nyxk,nk->nyx", shares, several[..., 2]), -99
    )
    expected = np.where(depth.max(axis=0) > -99, depth.argmax(axis=0), -1)
    assert np.array_equal(seen.triangle, expected)
    assert np.allclose(seen.depth[seen.covered], depth.max(axis=0)[seen.covered])
    assert np.allclose(seen.interpolated(several)[:, :2], places[seen.covered], atol=1e-3)


def test_a_view_from_any_side() -> None:
    red, blue = (
        ShadedPart.flat(slab(2, 0, 1), "#dd2222"),
        ShadedPart.flat(slab(2, -1, 0), "#2222dd"),
    )
    for direction, first in [((0, 0, 1), 0), ((0, 0, -1), 2), ((0.01, 0, 1), 0)]:
        picture = np.asarray(draw_solids([red, blue], (40, 40), SolidView(direction)))
        assert picture[20, 20].argmax() == first
    side = np.asarray(draw_solids([red, blue], (60, 60), SolidView((0, -1, 0))))
    assert side[15, 30].argmax() == 0
    assert side[45, 30].argmax() == 2
    over = np.asarray(draw_solids([red, blue], (60, 60), SolidView((0, -1, 0), up=(0, 0, -1))))
    assert over[15, 30].argmax() == 2
    far = np.asarray(
        draw_solids([red], (60, 60), SolidView((0, -1, 0), middle=(0, 0, 0.5), radius=9.0))
    )
    assert (far != 255).any(axis=2).mean() < 0.05


def test_smooth_parts_keep_their_creases() -> None:
    points, faces = triangles(Manifold.sphere(2, 32))
    assert np.abs(crease_normals(points, faces) - points[faces] / 2).max() < 0.06
    points, faces = triangles(Manifold.cube((1, 2, 3)))
    flat = ShadedPart.flat(points[faces], "#888888").normals
    assert crease_normals(points, faces) == pytest.approx(flat)
    assert crease_normals(points, faces, crease=100) != pytest.approx(flat)


def test_hollows_are_darker_and_parts_are_told_apart() -> None:
    floor = Manifold.cube((20, 20, 1)).translate((-10, -10, -1))
    open_floor, hollow = (
        np.asarray(draw_solids([ShadedPart.flat(corners(b), "#999999")], (200, 200), FROM_THE_TOP))
        for b in (floor, floor + Manifold.cube((4, 4, 4)).translate((-6, -2, 0)))
    )
    assert hollow[100, 88].mean() < open_floor[100, 88].mean() - 8
    halves = [
        ShadedPart.flat(slab(10, 0, 1) + np.array([5.0 * k, 0, 0]), "#999999") for k in (-1, 1)
    ]
    drawn, plain = (
        np.asarray(draw_solids(halves, (200, 200), FROM_THE_TOP, outlined=own))
        for own in (True, False)
    )
    assert drawn[100, 98:102].min() < plain[100, 98:102].min() - 30


def test_a_mirrored_part_is_seen_from_outside() -> None:
    points, faces = triangles(Manifold.sphere(1, 24))
    own = ShadedPart.smooth(points, faces, "#cc8844")
    whole = np.asarray(draw_solids([own], (60, 60), FROM_THE_TOP), float)
    mirrored = own.moved(np.diag([-1.0, 1.0, 1.0]))
    assert np.abs(np.asarray(draw_solids([mirrored], (60, 60), FROM_THE_TOP)) - whole).max() < 30
    assert own.moved(np.eye(3), (1, 2, 3)).corners == pytest.approx(
        own.corners + np.array([1, 2, 3])
    )
    clear = draw_solids([own], (60, 60), ground=None)
    assert clear.mode == "RGBA"
    assert clear.getpixel((0, 0)) == (0, 0, 0, 0)
    assert np.asarray(draw_solids([], (6, 4))).min() == 255


PARTS = {"block": Manifold.cube((1, 2, 3)), "ball": Manifold.sphere(1, 16)}


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


def test_a_group_is_one_object_with_a_filament_for_each_part(tmp_path: Path) -> None:
    """As objects of their own, slicers would drop all parts on the bed."""
    colours = {"block": "#c0ffee", "ball": "#102030"}
    content = write_3mf(PARTS, colours=colours, groups={"block": ["block", "ball"]})
    triangles = list(ElementTree.fromstring(model(content)).iter(f"{CORE}triangle"))
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        prusa = ElementTree.fromstring(archive.read("Metadata/Slic3r_PE_model.config"))
    block, ball = (
        range(int(own.get("firstid", "")), int(own.get("lastid", "")) + 1)
        for own in prusa.iter("volume")
    )
    assert (len(block), ball.start, ball.stop) == (12, 12, len(triangles))
    assert [row.get("paint_color") for row in triangles] == [None] * 12 + ["8"] * len(ball)
    (tmp_path / "a.3mf").write_bytes(content)
    assert [len(part) for part in read_triangles(tmp_path / "a.3mf")] == [12, len(ball)]


def test_colours_of_objects_are_filaments() -> None:
    content = write_3mf(PARTS, colours={"block": "#c0ffee", "ball": "#102030"})
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        for name in ("Slic3r_PE_model", "model_settings"):
            config = ElementTree.fromstring(archive.read(f"Metadata/{name}.config"))
            rows = [row.get("value") for row in config.iter() if row.get("key") == "extruder"]
            assert rows == ["1", "1", "2", "2"]  # of the object, and of its part
