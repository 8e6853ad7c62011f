"""Pictures and pages of densities: sizes, marks, contents, and what they refuse."""

import base64
import io
import json
import re
from functools import partial

import numpy as np
import pytest
import torch
from PIL import Image

import orbiflow.density as od
from density.blends import blended, bump
from orbiflow.density.pictures import density_on_grid, edge_pairs, grounds
from orbiflow.density.pictures.colours import (
    chosen_scale,
    density_at,
    is_sharp,
    shading,
    square_pixel,
)
from orbiflow.density.pictures.figures import few_colours
from orbiflow.density.pictures.frames import angle_axis, axis_label, view_of
from orbiflow.density.pictures.surfaces import boy_surface, mesh
from orbiflow.drawing import Sheet
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from refusals import refused
from strategies import random_orthogonal

TURN = random_orthogonal(np.random.default_rng(2), 3)
SPACES = [
    od.Torus(2, unit="degrees"), od.KleinBottle(), od.Sphere(rotation=TURN), od.ProjectivePlane(),
]  # fmt: skip
every_space = pytest.mark.parametrize("space", SPACES, ids=lambda s: s.name)


def example(space):
    field = FourierField(space.group, 2, dtype=torch.float64)
    generator = torch.Generator().manual_seed(3)
    field.parameters_.data.normal_(0, 0.01, generator=generator)
    return od.FlowDensity(space, Flow([field], steps=2))


def points(count, seed=0):
    return torch.tensor(np.random.default_rng(seed).uniform(-2, 2, (count, 2)))


def png(draw, *what, width_px=1600, samples=None, **options):
    more = {} if samples is None else {"samples": samples}
    settings, sheet = od.PlotSettings(**options), Sheet.screen(width_px)
    return draw(*what, **more, settings=settings, sheet=sheet).file()


density_png, flow_png = partial(png, od.density_picture), partial(png, od.flow_picture)
samples_png, corner_png = partial(png, od.samples_picture), partial(png, od.corner_picture)


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
    monkeypatch.setattr("orbiflow.density.pictures.square._GRID", 24)
    monkeypatch.setattr("orbiflow.density.pictures.square._FINE_GRID", 30)
    monkeypatch.setattr("orbiflow.density.pictures.surfaces._FINE_CELLS", 20)
    monkeypatch.setattr("orbiflow.density.pictures.surfaces._RESOLUTION", 30)
    monkeypatch.setattr("orbiflow.density.pictures.colours._COARSE", 24)
    monkeypatch.setattr("orbiflow.drawing.canvas._SAMPLES", 40)
    monkeypatch.setattr("orbiflow.drawing.canvas._STEPS", 2)


@every_space
def test_pictures_decode_at_the_asked_width(space):
    density = example(space)
    assert picture(density_png(density, points(40), width_px=320)).width == 320
    assert picture(flow_png(density, width_px=300)).width == 300
    assert picture(samples_png(density, points(30), points(20), width_px=310)).width == 310


def test_the_same_samples_give_the_same_picture_and_other_ones_another():
    density = example(SPACES[0])
    many = points(3500)
    first = density_png(density, many, width_px=300)
    assert first == density_png(density, many, width_px=300)
    assert first != density_png(density, width_px=300)


def test_what_cannot_be_drawn_is_refused():
    for dim in (1, 3):
        density, few = example(od.Torus(dim)), torch.zeros(3, dim)
        for draw in (density_png, flow_png, od.density_page, lambda d, s=few: samples_png(d, s, s)):
            with refused("two", "dimensions"):
                draw(density)
    for draw in (density_png, od.density_page):
        with refused("chart", "points"):
            draw(example(SPACES[0]), samples=torch.zeros(4, 3))
    with refused("flow"):
        flow_png(od.UniformDensity(SPACES[0]))


@every_space
def test_paired_edges_are_the_same_points(space):
    t, pairs = torch.linspace(0.1, 0.9, 7, dtype=torch.float64)[:, None], edge_pairs(space.group)
    middles = np.mean([edge for pair in pairs for edge in pair], axis=1).round(6)
    sides = {(0.0, 0.5), (1.0, 0.5), (0.5, 0.0), (0.5, 1.0)}
    assert {(x, y) for x, y in middles.tolist()} == sides
    for pair in pairs:
        first, second = (torch.tensor(edge) for edge in pair)
        one, other = (edge[0] + t * (edge[1] - edge[0]) for edge in (first, second))
        assert float(space.distance(one, other).max()) < 1e-6


def test_scales_are_chosen_and_checked():
    density = example(SPACES[0])
    assert density_png(density, scale="log", width_px=200)
    assert not chosen_scale(density, "natural", "auto")[0]
    assert chosen_scale(peaked(SPACES[0], 400.0), "natural", "auto")[0]
    page = od.density_page(peaked(SPACES[0], 400.0), resolution=12)
    assert any("10" in tick["text"] for tick in page_data(page)["ticks"])


def test_the_centre_moves_the_picture_but_not_its_colours(monkeypatch):
    density, drawn = peaked(SPACES[0], 30.0, at=(0.1, 0.8)), []
    shades = lambda values, *_, **__: drawn.append(values) or shading(values)  # noqa: E731
    monkeypatch.setattr(grounds, "shading", shades)
    for center in ((0, 0), (180, 180)):
        assert density_png(density, center=center, width_px=200)
    one, other = (values.reshape(30, 30).T for values in drawn)
    np.testing.assert_allclose(np.roll(one, 15, axis=(0, 1)), other, rtol=1e-6)
    peak = np.unravel_index(one.argmax(), one.shape)
    np.testing.assert_allclose((np.array(peak) + 0.5) / 30, (0.6, 0.3), atol=0.04)
    assert samples_png(density, points(9), points(9), center=(180, 180), width_px=300) != (
        samples_png(density, points(9), points(9), width_px=300)
    )


@pytest.mark.parametrize("draw", [density_png, flow_png])
def test_the_centre_is_checked(draw):
    with refused("klein-bottle"):
        draw(example(SPACES[1]), center=(0, 0))
    for center, message in (((0,), "angles 2"), ((0, np.nan), "finite number")):
        with refused(*message.split()):
            draw(example(SPACES[0]), center=center)


def test_axes_have_the_users_names():
    view = view_of(SPACES[1], ("direction", "mixture"))
    assert angle_axis(view, 0)[0] == "mixture (radians)"
    assert angle_axis(view, 1)[0] == "direction (radians)"
    assert axis_label(view_of(SPACES[0], ("x" * 99, "y")), 0) == f"{'x' * 39}… (degrees)"
    assert density_png(example(SPACES[0]), names=("$x_", "a^$"), width_px=200)
    names = od.PlotSettings(names=("phi", "psi<b>"))
    page = od.density_page(example(SPACES[0]), names, resolution=4)
    assert "φ (degrees) runs round the ring, psi&lt;b&gt; (degrees) round its tube" in page
    assert {"φ 90°", "φ −90°"} <= {label["text"] for label in page_data(page)["labels"]}
    with refused("2", "names"):
        density_png(example(SPACES[0]), names=("a",))


def peaked(space, kappa, at=(0.3, 0.4), flow=0.01):
    """Mostly one kernel."""
    shares = torch.tensor([flow, 0.99 - flow, 0.01], dtype=torch.float64)
    return blended(
        space, example(space).flow, od.UniformDensity(space), bump(space, kappa, at), shares
    )


@every_space
@pytest.mark.parametrize("measure", ["natural", "square", "uniform"])
def test_broad_kernels_are_drawn_as_they_are(space, measure):
    density, t = peaked(space, 3.0, flow=0.4), torch.linspace(0.03, 0.97, 9, dtype=torch.float64)
    grid = torch.stack(torch.meshgrid(t, t[:5], indexing="ij"), dim=-1).reshape(-1, 2)
    found = density_on_grid(density, t, t[:5], measure, pixel=1e-6)
    exact = density_at(density, grid, measure).reshape(9, 5)
    np.testing.assert_allclose(found, exact, rtol=1e-5)
    assert not is_sharp(density, square_pixel(space, 0.01))


@every_space
@pytest.mark.parametrize("at", [(0.3, 0.4), (0.3087, 0.4131), (0.316, 0.46)])
def test_peaks_narrower_than_a_pixel_keep_their_mass_wherever_they_lie(space, at):
    density, t = peaked(space, 1e7, at), (torch.arange(90, dtype=torch.float64) + 0.5) / 90
    values = density_on_grid(density, t, t, "square")
    assert values.mean() == pytest.approx(1.0, abs=0.03)
    peak = (np.array(np.unravel_index(values.argmax(), values.shape)) + 0.5) / 90
    assert abs(peak - at).max() < 1 / 90
    assert is_sharp(density, square_pixel(space, 1 / 90))


def test_densities_with_kernels_are_drawn_and_say_what_is_averaged():
    space = SPACES[2]
    density = peaked(space, 1e6)
    assert density_png(density, width_px=250) != density_png(peaked(space, 10.0), width_px=250)
    assert flow_png(density, width_px=200)
    assert samples_png(density, points(9), density.sample((20,)), width_px=300)
    assert "narrower than" in od.density_page(density, resolution=8)
    assert "narrower than" not in od.density_page(example(space), resolution=8)


def test_a_flow_in_few_colours_is_small(monkeypatch):
    monkeypatch.setattr("orbiflow.drawing.canvas._STEPS", 12)  # lines of the whole length
    small = few_colours(flow_png(example(SPACES[0]), width_px=500))
    assert len(small) < 150_000
    image = Image.open(io.BytesIO(small))
    assert image.mode == "P"


@pytest.mark.parametrize("dim", [1, 3])
def test_pairs_of_angles(dim):
    density = od.UniformDensity(od.Torus(dim, unit="degrees"))
    data = torch.tensor(np.random.default_rng(0).random((40, dim)))
    names = [f"${k}_" for k in range(dim)]
    both = corner_png(density, data, data[:9], names=names, width_px=400)
    assert picture(both).size == (400, 400)
    assert corner_png(density, None, data, center=[90] * dim, width_px=300)
    with refused("chart", "points"):
        corner_png(density, data[:, :0], data)


@pytest.mark.parametrize("space", [od.Torus(9), SPACES[2]], ids=["torus", "sphere"])
def test_pairs_of_other_spaces_are_refused(space):
    with refused("angles", "1", "8"):
        corner_png(od.FlowDensity(space, example(SPACES[0]).flow), None, torch.zeros(3, 9))


@every_space
@pytest.mark.parametrize("measure", ["natural", "square"])
def test_density_is_finite_at_every_vertex(space, measure):
    assert np.isfinite(density_at(example(space), mesh(space, 8).points, measure)).all()


@every_space
def test_page_stands_alone(space):
    settings, title = od.PlotSettings(dots=True), "A < B & C"
    page = od.density_page(example(space), settings, resolution=8, samples=points(9), title=title)
    assert not re.search(r"https?://|//cdn|@import|\bfetch\(|XMLHttpRequest|\ssrc=", page)
    assert "{{" not in page
    assert "A &lt; B &amp; C" in page
    assert 'aria-label="' in page
    data = page_data(page)
    assert len(array(data["samples"], "<f4")) == 27
    assert data["dots"]
    assert len(array(data["colours"], "u1")) == 1024
    triangles = array(data["triangles"], "<u2")
    assert len(triangles) == 2 * 8 * 8 * 3
    assert len(array(data["normals"], "i1")) == len(array(data["points"], "<f4"))
    assert triangles.max() + 1 == len(array(data["values"], "<u2"))


def test_largest_page_is_below_three_megabytes():
    page = od.density_page(example(SPACES[2]), resolution=250, samples=points(5000))
    assert len(page.encode()) < 3_000_000


def test_too_large_a_page_is_refused():
    coast = np.random.default_rng(0).uniform(-60, 60, (200_000, 2))
    with refused("MB"):
        od.density_page(example(SPACES[2]), resolution=8, coastlines=[coast])


@pytest.mark.parametrize("space", [SPACES[0], SPACES[2]], ids=lambda s: s.name)
def test_colours_close_over_the_seams(space):
    # where a surface does not cross itself, vertices at one place are one point
    data = page_data(od.density_page(example(space), resolution=12))
    places = array(data["points"], "<f4").reshape(-1, 3)
    values = array(data["values"], "<u2").astype(int)
    one, other = np.nonzero(np.linalg.norm(places[:, None] - places, axis=-1) < 1e-6)
    corner = ((mesh(space, 12).points - 0.5).abs().amin(dim=1) > 0.49).numpy()
    apart = (one != other) & ~corner[one] & ~corner[other]
    assert apart.sum() == 2 * 2 * 11
    assert abs(values[one] - values[other])[apart].max() <= 2


def test_sphere_page_has_the_users_frame_and_coastlines():
    space = SPACES[2]
    where = np.array([[48.2, 16.4], [40.0, -74.0], [-33.9, 151.2]])
    samples = space.to_chart(where)
    data = page_data(
        od.density_page(
            example(space), resolution=8, samples=samples, coastlines=[where, where[:1]]
        )
    )
    np.testing.assert_allclose(
        array(data["samples"], "<f4").reshape(-1, 3), od.to_vectors(where), atol=1e-6
    )
    coast = data["lines"][-1]
    assert coast["counts"] == [3]
    np.testing.assert_allclose(
        array(coast["points"], "<f4").reshape(-1, 3), od.to_vectors(where), atol=1e-6
    )
    north = next(label for label in data["labels"] if label["text"] == "N")
    assert north["at"][2] > 1


def test_coastlines_on_axes():
    where = np.array([[10.0, 20.0], [30.0, 40.0]])
    data = page_data(od.density_page(example(SPACES[3]), resolution=4, coastlines=[where]))
    np.testing.assert_allclose(
        array(data["lines"][-1]["points"], "<f4").reshape(-1, 3),
        boy_surface(od.to_vectors(where)),
        atol=1e-6,
    )
