"""Pictures and pages of densities: sizes, marks, contents, and what they refuse."""

import base64
import io
import json
import re

import numpy as np
import pytest
import torch
from PIL import Image

from orbiflow.density.density import SymmetricDensity
from orbiflow.density.flat_spaces import KleinBottle, Torus
from orbiflow.density.round_spaces import ProjectivePlane, Sphere, to_vectors
from orbiflow.draw.density_page import density_page
from orbiflow.draw.density_square import (
    angle_text,
    density_at,
    density_png,
    flow_png,
    measure_label,
    samples_png,
    shading,
)
from orbiflow.draw.immersions import boy_surface, edge_pairs, mesh
from orbiflow.errors import OrbiflowError
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from strategies import random_orthogonal

TURN = random_orthogonal(np.random.default_rng(2), 3)
SPACES = [Torus(2, unit="degrees"), KleinBottle(), Sphere(rotation=TURN), ProjectivePlane()]
every_space = pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)


def example(space, dtype=torch.float64):
    field = FourierField(space.group, 2, dtype=dtype)
    generator = torch.Generator().manual_seed(3)
    field.parameters_.data.normal_(0, 0.01, generator=generator)
    return SymmetricDensity(space, Flow([field], steps=2))


def points(count, seed=0):
    return torch.tensor(np.random.default_rng(seed).uniform(-2, 2, (count, 2)))


def picture(png):
    return Image.open(io.BytesIO(png)).convert("RGB")


def page_data(page):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert found
    return json.loads(found[1])


def array(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=kind)


@pytest.fixture(autouse=True)
def _coarse(monkeypatch):
    monkeypatch.setattr("orbiflow.draw.density_square._GRID", 24)
    monkeypatch.setattr("orbiflow.draw.field._SAMPLES", 40)


@every_space
def test_pictures_decode_at_the_asked_width(space):
    density = example(space)
    assert picture(density_png(density, points(40), width_px=320)).width == 320
    assert picture(flow_png(density, cells=2, width_px=300)).width == 300
    assert picture(samples_png(density, points(30), points(20), width_px=310)).width == 310


def test_the_same_samples_give_the_same_picture_and_other_ones_another():
    density = example(SPACES[0])
    many = points(3500)
    first = density_png(density, many, width_px=300)
    assert first == density_png(density, many, width_px=300)
    assert first != density_png(density, width_px=300)


def test_all_measures_are_drawn_and_another_is_refused():
    density = example(SPACES[2])
    for measure in ("natural", "square", "uniform"):
        assert density_png(density, measure=measure, width_px=200)
    with pytest.raises(OrbiflowError, match="measure"):
        density_png(density, measure="flat")


def test_single_precision_is_drawn():
    density = example(SPACES[1], torch.float32)
    assert density_png(density, width_px=200)
    assert flow_png(density, cells=1, width_px=200)


@pytest.mark.parametrize("dim", [1, 3])
def test_other_dimensions_are_refused(dim):
    density = example(Torus(dim))
    for draw in (density_png, flow_png, density_page):
        with pytest.raises(OrbiflowError, match="two dimensions"):
            draw(density)
    with pytest.raises(OrbiflowError, match="two dimensions"):
        samples_png(density, torch.zeros(3, dim), torch.zeros(3, dim))


@pytest.mark.parametrize("cells", [0, 10, 1.5])
def test_number_of_cells_is_checked(cells):
    with pytest.raises(OrbiflowError, match="cells"):
        flow_png(example(SPACES[0]), cells=cells)


def test_samples_of_another_shape_are_refused():
    for draw in (density_png, density_page):
        with pytest.raises(OrbiflowError, match="chart points"):
            draw(example(SPACES[0]), samples=torch.zeros(4, 3))


EDGES = {
    "torus": [("left up", "right up"), ("bottom right", "top right")],
    "klein-bottle": [("left up", "right up"), ("bottom right", "top left")],
    "sphere": [("left up", "bottom right"), ("right down", "top left")],
    "projective-plane": [("left up", "right down"), ("bottom right", "top left")],
}


def edge_name(edge):
    (x, y), (u, v) = edge.round().astype(int)
    if x == u:
        return f"{'right' if x else 'left'} {'up' if v > y else 'down'}"
    return f"{'top' if y else 'bottom'} {'right' if u > x else 'left'}"


@every_space
def test_edges_are_paired_as_the_space_identifies_them(space):
    found = {tuple(sorted(edge_name(edge) for edge in pair)) for pair in edge_pairs(space.group)}
    expected = [tuple(sorted(pair)) for pair in EDGES[space.name]]
    swap = {"up": "down", "down": "up", "left": "right", "right": "left"}

    def reversed_pair(pair):
        parts = [name.split() for name in pair]
        return tuple(sorted(f"{side} {swap[way]}" for side, way in parts))

    assert len(found) == 2
    assert all(pair in found or reversed_pair(pair) in found for pair in expected)


@every_space
def test_paired_edges_are_the_same_points(space):
    t = torch.linspace(0.1, 0.9, 7, dtype=torch.float64)[:, None]
    for pair in edge_pairs(space.group):
        first, second = (torch.tensor(edge) for edge in pair)
        one, other = (edge[0] + t * (edge[1] - edge[0]) for edge in (first, second))
        assert float(space.distance(one, other).max()) < 1e-6


@pytest.mark.parametrize(
    ("turns", "unit", "text"),
    [
        (0.5, "radians", "π"),
        (-0.25, "radians", "−π/2"),
        (0, "radians", "0"),
        (0.125, "degrees", "45°"),
        (0.25, "turns", "0.25"),
    ],
)
def test_angles_are_written_in_their_unit(turns, unit, text):
    assert angle_text(turns, unit) == text


def test_measures_are_named():
    assert measure_label(SPACES[0], "natural") == "density, per degree²"
    assert measure_label(SPACES[2], "natural") == "density, per steradian"
    assert "uniform" in measure_label(SPACES[2], "uniform")
    assert "square" in measure_label(SPACES[1], "square")


def test_a_few_far_values_do_not_darken_the_picture():
    values = np.full(10_000, 1.0)
    assert shading(values) == (0.0, 1.0, False)
    values[:5] = 50.0
    assert shading(values) == (0.0, 1.0, True)
    assert shading(values, np.where(values > 1, 1000.0, 1.0)) == (0.0, 50.0, False)


@every_space
@pytest.mark.parametrize("measure", ["natural", "square"])
def test_density_is_finite_at_every_vertex(space, measure):
    assert np.isfinite(density_at(example(space), mesh(space, 8).points, measure)).all()


@every_space
def test_page_stands_alone(space):
    page = density_page(example(space), resolution=8, samples=points(9), title="A < B & C")
    assert not re.search(r"https?://|//cdn|@import|\bfetch\(|XMLHttpRequest|\ssrc=", page)
    assert "%DATA%" not in page
    assert "A &lt; B &amp; C" in page
    assert 'aria-label="' in page
    data = page_data(page)
    assert len(array(data["samples"], "<f4")) == 27
    assert len(array(data["colours"], "u1")) == 1024
    triangles = array(data["triangles"], "<u2")
    assert len(triangles) == 2 * 8 * 8 * 3
    assert len(array(data["normals"], "i1")) == len(array(data["points"], "<f4"))
    assert triangles.max() + 1 == len(array(data["values"], "<u2"))


def test_largest_page_is_below_three_megabytes():
    page = density_page(example(SPACES[2]), resolution=200, samples=points(5000))
    assert len(page.encode()) < 3_000_000


def test_too_large_a_page_is_refused():
    coast = np.random.default_rng(0).uniform(-60, 60, (200_000, 2))
    with pytest.raises(OrbiflowError, match="MB"):
        density_page(example(SPACES[2]), resolution=8, coastlines=[coast])


@pytest.mark.parametrize("space", [SPACES[0], SPACES[2]], ids=lambda s: s.name)
def test_colours_close_over_the_seams(space):
    # where a surface does not cross itself, vertices at one place are one point
    data = page_data(density_page(example(space), resolution=12))
    places = array(data["points"], "<f4").reshape(-1, 3)
    values = array(data["values"], "<u2").astype(int)
    one, other = np.nonzero(np.linalg.norm(places[:, None] - places, axis=-1) < 1e-6)
    corner = ((mesh(space, 12).points - 0.5).abs().amin(dim=1) > 0.49).numpy()
    apart = (one != other) & ~corner[one] & ~corner[other]
    assert apart.sum() == 2 * 2 * 11
    assert abs(values[one] - values[other])[apart].max() <= 2


@every_space
def test_density_is_the_same_at_both_copies_of_an_edge(space):
    density, t = example(space), torch.linspace(0.05, 0.95, 9, dtype=torch.float64)[:, None]
    for pair in edge_pairs(space.group):
        first, second = (torch.tensor(edge) for edge in pair)
        one, other = (edge[0] + t * (edge[1] - edge[0]) for edge in (first, second))
        np.testing.assert_allclose(
            density_at(density, one, "natural"), density_at(density, other, "natural"), rtol=1e-6
        )


def test_sphere_page_has_the_users_frame_and_coastlines():
    space = SPACES[2]
    where = np.array([[48.2, 16.4], [40.0, -74.0], [-33.9, 151.2]])
    samples = space.to_chart(where)
    data = page_data(
        density_page(example(space), resolution=8, samples=samples, coastlines=[where, where[:1]])
    )
    np.testing.assert_allclose(
        array(data["samples"], "<f4").reshape(-1, 3), to_vectors(where), atol=1e-6
    )
    coast = data["lines"][-1]
    assert coast["counts"] == [3]
    np.testing.assert_allclose(
        array(coast["points"], "<f4").reshape(-1, 3), to_vectors(where), atol=1e-6
    )
    north = next(label for label in data["labels"] if label["text"] == "N")
    assert north["at"][2] > 1


def test_coastlines_on_axes_and_nowhere_else():
    where = np.array([[10.0, 20.0], [30.0, 40.0]])
    data = page_data(density_page(example(SPACES[3]), resolution=4, coastlines=[where]))
    np.testing.assert_allclose(
        array(data["lines"][-1]["points"], "<f4").reshape(-1, 3),
        boy_surface(to_vectors(where)),
        atol=1e-6,
    )
    with pytest.raises(OrbiflowError, match="coastlines"):
        density_page(example(SPACES[0]), resolution=4, coastlines=[where])
