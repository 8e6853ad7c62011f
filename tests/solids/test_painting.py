"""What is painted on a mesh: read in each format, kept where it is mended, and what it matters."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.arrays import Array
from orbiflow.errors import SettingError
from orbiflow.runtime import Cancel, Cancelled, Event, Note
from orbiflow.solids.mesh import Mesh, joined
from orbiflow.solids.operations import fill as fill_operation
from orbiflow.solids.painting import Painting, checked_painting, spread
from orbiflow.solids.reading import read_mesh
from orbiflow.solids.search import SolidGoal
from orbiflow.solids.settings import EmphasisSphere, FillSettings, Painted
from orbiflow.solids.soup import Soup
from refusals import refused
from solids.known_solids import creature
from solids.mesh_files import CORE, archive, ball, bare_reads, obj, stl
from solids.small_fills import SMALL, creature_file

GREY, RED = (0.8, 0.8, 0.8), (0.9, 0.1, 0.1)


def big() -> Mesh:
    """The creature, some 60 mm long."""
    return creature().moved(25 * np.eye(3))


def head_of(mesh: Mesh) -> Array:
    """Which of the points are of the creature's head (N,)."""
    return (mesh.points[:, 0] > 18) & (mesh.points[:, 2] > 0)


def colours_of(mesh: Mesh) -> Array:
    """A grey creature with a red head (N, 3)."""
    return np.where(head_of(mesh)[:, None], RED, GREY)


def share_of_head(mesh: Mesh) -> float:
    """The share of its area, by faces, that is of the head."""
    areas = np.linalg.norm(mesh.face_vectors, axis=1)
    return float(areas @ head_of(mesh)[mesh.faces].mean(axis=1) / areas.sum())


def ply(mesh: Mesh, colours: Array, of: str = "vertex_colors") -> bytes:
    """A PLY with colours of its points or faces."""
    own: Any = trimesh.Trimesh(mesh.points, mesh.faces, process=False)
    setattr(own.visual, of, np.rint(255 * colours).astype(np.uint8))
    return own.export(file_type="ply")


def with_faces_coloured(mesh: Mesh) -> bytes:
    return ply(mesh, colours_of(mesh)[mesh.faces].mean(axis=1), "face_colors")


def painted_obj(mesh: Mesh, most: float = 1.0) -> bytes:
    lines = obj(mesh).decode().splitlines()
    for k, colour in enumerate(colours_of(mesh)):
        lines[k] += " {:.4g} {:.4g} {:.4g}".format(*(most * colour))
    return "\n".join(lines).encode()


def painted_glb(mesh: Mesh, kind: type) -> bytes:
    """A GLB in metres whose colours have 8 or 16 bits, or are floating-point numbers."""
    small = mesh.moved(0.001 * np.eye(3))
    own = trimesh.Trimesh(small.points, small.faces, process=False)
    most = 1 if kind is np.float32 else np.iinfo(kind).max
    values = np.column_stack([colours_of(mesh), np.ones(len(mesh.points))]) * most
    own.vertex_attributes["_OLOR_0"] = values.astype(kind)
    content: Any = own.export(file_type="glb")
    assert content.count(b'"_OLOR_0"') == 1
    return content.replace(b'"_OLOR_0"', b'"COLOR_0"')


def painted_3mf(mesh: Mesh, by: str) -> bytes:
    """A 3MF whose triangles have colours, at corners, or whose object has one and the head another."""
    red = head_of(mesh)[mesh.faces]
    rows = list[str]()
    for face, own in zip(mesh.faces, red.astype(int), strict=True):
        corners = 'v1="{}" v2="{}" v3="{}"'.format(*face)
        paint = 'pid="7" p1="{}" p2="{}" p3="{}"'.format(*own)
        if by == "object":
            paint = 'pid="7" p1="1"' if own.all() else ""
        rows.append(f"<triangle {corners} {paint}/>")
    points = "".join('<vertex x="{:.9g}" y="{:.9g}" z="{:.9g}"/>'.format(*p) for p in mesh.points)
    colours = "#CCCCCC", "#E61A1AFF"
    palette = "".join(f'<m:color color="{own}"/>' for own in colours)
    palette = f'<m:colorgroup id="7">{palette}</m:colorgroup>'
    if by == "object":
        palette = "".join(f'<base name="{own}" displaycolor="{own}"/>' for own in colours)
        palette = f'<basematerials id="7">{palette}</basematerials>'
    return archive(
        f'<model unit="millimeter" xmlns="{CORE}" xmlns:m="http://example.org/m"><resources>{palette}'
        f'<object id="1" pid="7" pindex="0"><mesh><vertices>{points}</vertices><triangles>'
        f'{"".join(rows)}</triangles></mesh></object></resources><build><item objectid="1"/></build>'
        "</model>"
    )


FILES = {
    "a.ply": lambda mesh: ply(mesh, colours_of(mesh)),
    "faces.ply": with_faces_coloured,
    "a.obj": painted_obj,
    "bytes.obj": lambda mesh: painted_obj(mesh, 255.0),
    "a.glb": lambda mesh: painted_glb(mesh, np.uint8),
    "a16.glb": lambda mesh: painted_glb(mesh, np.uint16),
    "float.glb": lambda mesh: painted_glb(mesh, np.float32),
    "a.3mf": lambda mesh: painted_3mf(mesh, "corners"),
    "object.3mf": lambda mesh: painted_3mf(mesh, "object"),
}


def painting_of(folder: Path, name: str, content: bytes) -> Painting:
    (folder / name).write_bytes(content)
    found = read_mesh(folder / name).painting
    assert found is not None
    return found


@pytest.mark.parametrize("name", FILES)
def test_paint_is_read_in_each_format(name: str, tmp_path: Path, monkeypatch) -> None:
    if name != "a.3mf":
        bare_reads(monkeypatch)
    mesh = big()
    found = painting_of(tmp_path, name, FILES[name](mesh))
    assert found.share == pytest.approx(share_of_head(mesh), abs=0.015)
    weights = found.weights(8.0, mesh.points)
    assert weights.min() == 1
    assert weights.max() == 8
    clear = np.abs(mesh.points[:, 0] - 18) > 5  # mm from the edge of paint
    np.testing.assert_allclose(weights[clear], np.where(head_of(mesh), 8.0, 1.0)[clear], atol=1.0)


def test_paint_is_kept_where_a_mesh_is_mended(tmp_path: Path) -> None:
    one, other = ball(20.0, segments=40), ball(20.0, (20, 0, 0), segments=40)
    both = joined([one, other])
    colours = np.where(np.arange(len(both.points))[:, None] < len(one.points), GREY, RED)
    united = painting_of(tmp_path, "a.ply", ply(both, colours))
    assert united.share == pytest.approx(0.5, abs=0.02)
    mark = united.weights(5.0, np.array([[-19.9, 0, 0], [39.9, 0, 0]]))
    assert mark.tolist() == [1.0, 5.0]
    # a seam: each side has points of its own
    apart = Mesh(both.points[both.faces].reshape(-1, 3), np.arange(both.faces.size).reshape(-1, 3))
    again = painting_of(tmp_path, "a.ply", ply(apart, colours[both.faces.ravel()]))
    assert again.share == pytest.approx(united.share, abs=1e-9)
    # what is only on a scrap that is left out is nowhere
    scrap = joined([one, ball(2.0, (50, 0, 0))])
    colours = np.where(np.arange(len(scrap.points))[:, None] < len(one.points), GREY, RED)
    assert painting_of(tmp_path, "a.ply", ply(scrap, colours)).share == 0


@settings(max_examples=6, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.02, 0.45), st.floats(0.3, 0.9))
def test_the_rarer_colour_is_paint_whatever_the_colours(seed, share, apart) -> None:
    rng = np.random.default_rng(seed)
    mesh = ball(1.0, segments=48)
    usual = rng.uniform(size=3)
    paint = usual.copy()
    paint[0] += apart if usual[0] + apart <= 1 else -apart
    own = mesh.points[:, 2] > 1 - 2 * share  # a cap of a sphere has this share of its area
    if not 0 <= paint[0] <= 1:
        return
    noise = rng.uniform(-0.01, 0.01, mesh.points.shape)
    colours = np.clip(np.where(own[:, None], paint, usual) + noise, 0, 1)
    found = Painting.of(Soup(mesh.points, mesh.faces, colours), mesh)
    assert found is not None
    assert found.share == pytest.approx(share, abs=0.06)


@given(st.integers(0, 2**32 - 1))
def test_places_are_even_on_triangles(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points, faces = rng.normal(size=(8, 3)), rng.integers(0, 8, size=(5, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    if not len(faces):
        return
    places, face, shares = spread(points, faces, 4000)
    assert shares.min() >= 0
    np.testing.assert_allclose(shares.sum(axis=1), 1)
    np.testing.assert_allclose(np.einsum("nk,nkc->nc", shares, points[faces[face]]), places)
    mesh = Mesh(points, faces)
    areas = np.linalg.norm(mesh.face_vectors, axis=1)
    counts = np.bincount(face, minlength=len(faces))
    np.testing.assert_allclose(counts / 4000, areas / areas.sum(), atol=1e-3)


def test_what_is_painted_matters_more() -> None:
    mesh = big()
    painting = Painting.of(Soup(mesh.points, mesh.faces, colours_of(mesh)), mesh)
    plain = SolidGoal.of(mesh, FillSettings()).body(0.17)
    heavy = SolidGoal.of(mesh, FillSettings(emphasis=("painted,20",)), painting=painting).body(0.17)
    more = (heavy.importance / plain.importance)[: plain.size]
    head = plain.rest[: plain.size, 0] > 1.0
    body = plain.rest[: plain.size, 0] < 0.4
    assert head.sum() > 10
    np.testing.assert_allclose(more[head], 20, rtol=0.1)
    np.testing.assert_allclose(more[body], 1)


def test_it_is_asked_for_by_one_word() -> None:
    asked = FillSettings(emphasis=("painted", "Painted 8", "1,2,3,4")).emphasised
    assert asked == (Painted(), Painted(8.0), EmphasisSphere((1, 2, 3), 4))
    for wrong in ("painted,1,2", "painted,red", "painted,1000", "paint"):
        with refused("emphasis", kind=SettingError):
            FillSettings(emphasis=(wrong,))


def test_what_cannot_be_meant_is_refused(tmp_path: Path) -> None:
    asked = SMALL.replace(emphasis=("painted",))
    with refused("emphasis", "painted", "x,y,z", kind=SettingError):
        fill_operation(creature_file(tmp_path), tmp_path / "out", asked)
    mesh = big()
    grey = np.tile(GREY, (len(mesh.points), 1))
    only = tmp_path / "grey.ply"
    only.write_bytes(ply(mesh, grey))
    with refused("emphasis", "painted", "colour", kind=SettingError):
        fill_operation(only, tmp_path / "out", asked)
    rainbow = (mesh.points - mesh.points.min(axis=0)) / np.ptp(mesh.points, axis=0)
    found = painting_of(tmp_path, "rainbow.ply", ply(mesh, rainbow))
    with refused("emphasis", "painted", "%", kind=SettingError):
        checked_painting(found)
    assert not (tmp_path / "out").exists()
    # a mesh without colours is read as ever
    (tmp_path / "plain.stl").write_bytes(stl(mesh))
    assert read_mesh(tmp_path / "plain.stl").painting is None


def test_it_is_said_how_much_is_painted(tmp_path: Path) -> None:
    (tmp_path / "a.obj").write_bytes(painted_obj(big()))
    cancel, told = Cancel(), list[Event]()
    cancel.cancel()
    asked, out = SMALL.replace(emphasis=("painted,8",)), tmp_path / "out"
    with pytest.raises(Cancelled):
        fill_operation(tmp_path / "a.obj", out, asked, on_event=told.append, cancel=cancel)
    share = 100 * share_of_head(big())
    (text,) = [own.text for own in told if isinstance(own, Note)]
    assert text.startswith("what is painted, ")
    assert float(text.split()[3]) == pytest.approx(share, abs=1.5)
    assert text.endswith("% of the surface, matters 8 times as much as the rest")
