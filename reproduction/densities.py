"""Densities estimated on the four spaces: their targets, the table of divergences, their pictures.

The targets are four and six Gaussians of variance 0.005 on the unit square, and the 5 x 5 checkerboard
(paper, section 5.3). On the sphere they are also taken per round area: the same function times the
area factor.
"""

from __future__ import annotations

import functools
import math
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np
import torch
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density import (
    COLOURS,
    SPACES,
    Density,
    FlowSettings,
    PlotSettings,
    Space,
    density_page,
    density_to_bytes,
    fit_density,
    make_space,
    read_density,
)
from orbiflow.density.models import kl_by_quadrature, midpoints
from orbiflow.density.pictures import density_on_grid, draw_cells, mean_field, viewpoint
from orbiflow.drawing import draw_flow, draw_magnitude, plane_axes
from reproduction.drawing import (
    INK,
    Canvas,
    caption,
    draw_surface,
    grid_box,
    label,
    text_size,
    tiny,
)
from reproduction.exhibit import Exhibit, Extent, Findings, Table, Work
from reproduction.spaces import TITLES
from reproduction.symmetrization import equivariance_error

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NAMES = {
    "4-gaussian": "4 Gaussians",
    "6-gaussian": "6 Gaussians",
    "checkerboard": "5 × 5 checkerboard",
}
TARGETS = tuple(NAMES)

# the paper's table of KL divergences, as printed
KL = {
    "torus": {"4-gaussian": 0.03, "6-gaussian": 0.45, "checkerboard": 0.67},
    "sphere": {"4-gaussian": 0.03, "6-gaussian": 0.47, "checkerboard": 0.56},
}
TargetMeasure = Literal["flat", "round"]

_SMOOTH = {"max_frequency": 6, "segments": 8, "roughness": (1e-3, 1e-3)}
_SHARP = {"max_frequency": 8, "segments": 6, "roughness": (1e-4, 1e-4)}
# the `FlowSettings` that suit each target
FIT_SETTINGS = {"4-gaussian": _SMOOTH, "6-gaussian": _SMOOTH, "checkerboard": _SHARP}


def target(name: str, points: Tensor) -> Tensor:
    """Return a target's density (N,) at points (N, 2), per area of the square, nearly normalised.

    >>> target("checkerboard", torch.tensor([[0.1, 0.1], [0.3, 0.1]])).round(decimals=2).tolist()
    [1.9199999570846558, 0.0]
    """
    if name == "checkerboard":
        cells = (points * 5).floor().clamp(0, 4).sum(dim=-1)
        return (cells % 2 == 0).to(points) * 25 / 13
    if name == "4-gaussian":
        means = torch.tensor([[x, y] for x in (0.25, 0.75) for y in (0.25, 0.75)])
    else:
        angle = torch.arange(6) * math.pi / 3
        means = 0.5 + 0.3 * torch.stack([angle.cos(), angle.sin()], dim=-1)
    squared = ((points[..., None, :] - means.to(points)) ** 2).sum(dim=-1)
    return (-squared / 0.01).exp().mean(dim=-1) / (2 * math.pi * 0.005)


def weighted(name: str, space: Space, points: Tensor, measure: TargetMeasure) -> Tensor:
    """Return the target (N,) per area of the square, if it is given in `measure`."""
    factor = space.log_area(points).exp() if measure == "round" else 1.0
    return target(name, points) * factor


def drawn(name: str, space: Space, measure: TargetMeasure, count: int, seed: int) -> Tensor:
    """Draw samples (count, 2) of a target, by rejection."""
    generator = torch.Generator().manual_seed(seed)
    most = 1.1 * float(weighted(name, space, midpoints(space, 400), measure).max())
    found: list[Tensor] = []
    while sum(len(part) for part in found) < count:
        points = torch.rand(4 * count, 2, dtype=torch.float64, generator=generator)
        chance = torch.rand(4 * count, dtype=torch.float64, generator=generator)
        found.append(points[chance * most < weighted(name, space, points, measure)])
    return torch.cat(found)[:count]


def kl_of_uniform(name: str, space: Space, grid: int = 400) -> float:
    """Return the KL divergence of the square's uniform density from a target: that of no fit at all.

    >>> from orbiflow.density import make_space
    >>> round(kl_of_uniform("checkerboard", make_space("torus")), 3)  # log(25 / 13)
    0.654
    """
    points = midpoints(space, grid)
    return kl_by_quadrature(target(name, points), torch.zeros(len(points), dtype=torch.float64))


class Fitted(NamedTuple):
    """A density fitted to samples of a target, saved by `density_to_bytes`, and its integral.

    - `kl`: The divergence from the target in nats, by quadrature with doubled steps of the flow.
    """

    space: str
    target: str
    measure: TargetMeasure
    saved: bytes
    kl: float
    mass: float

    def density(self) -> Density:
        """Return the density."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "density.safetensors"
            path.write_bytes(self.saved)
            return read_density(path)[0]


def fitted(
    space: str, target: str, measure: TargetMeasure, points: int, evaluations: int, grid: int
) -> Fitted:
    """Draw samples of a target, fit a density to them, and measure its divergence."""
    there = make_space(space)
    samples = drawn(target, there, measure, points, seed=0)
    settings = FlowSettings(evaluations=evaluations, **FIT_SETTINGS[target])  # type: ignore[arg-type]
    density, report = fit_density(there, samples, settings)
    places = midpoints(there, grid)
    with torch.no_grad():
        values = density.with_steps(2 * density.flow.steps).log_prob(places)
    kl = kl_by_quadrature(weighted(target, there, places, measure), values)
    return Fitted(space, target, measure, density_to_bytes(density), kl, float(report.mass or 0.0))


def fit_work(space: str, target: str, extent: Extent, measure: TargetMeasure = "flat") -> Work:
    """Return a fit as work."""
    arguments = (space, target, measure, extent.points, extent.evaluations, extent.grid)
    return Work(fitted, arguments, 2 + extent.evaluations / 12)


_box = functools.partial(grid_box, rows=2, columns=5, title=0.12, left=0.03)
_HALF_WINDOW = (-0.5, -0.5, 1.5, 1.5)


def square_values(density: Density, count: int) -> Array:
    """Return the density (count, count) per area of the square at an even grid's midpoints, x first."""
    t = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    return density_on_grid(density, t, t, "square")


def _fits(extent: Extent) -> list[tuple[str, TargetMeasure]]:
    """Return the spaces and measures of the table; if there is time, more than the paper's."""
    if extent.name == "fast":
        return [(space, "flat") for space in KL]
    return [*((space, "flat") for space in SPACES), ("sphere", "round")]


def _needs_table(extent: Extent) -> list[Work]:
    return [fit_work(s, name, extent, measure) for s, measure in _fits(extent) for name in TARGETS]


def _draw_table(_canvas: Canvas, extent: Extent, values: list[Fitted]) -> Findings:
    found = {(one.space, one.target, one.measure): one for one in values}
    uniform = {name: kl_of_uniform(name, make_space("torus")) for name in TARGETS}
    rows = []
    for space, measure in _fits(extent):
        printed = KL.get(space, {}) if measure == "flat" else {}
        cells = [f"{printed[name]:.2f}" if printed else "–" for name in TARGETS]
        ours = [f"{found[space, name, measure].kl:.4f}" for name in TARGETS]
        title = TITLES[space] if measure == "flat" else f"{TITLES[space]}, round area"
        rows.append((title, *cells, *ours))
    rows.append(("the even density", *(f"{uniform[name]:.3f}" for name in TARGETS), "", "", ""))
    heads = ("space", *(f"{who}, {NAMES[n]}" for who in ("paper", "here") for n in TARGETS))
    cells = [(space, name) for space in KL for name in TARGETS]
    better = sum(found[s, n, "flat"].kl < KL[s][n] for s, n in cells)
    worse = [f"{NAMES[n]} on the {TITLES[s]}" for s, n in cells if KL[s][n] > uniform[n]]
    gained = [1 - KL[s]["6-gaussian"] / uniform["6-gaussian"] for s in KL]
    mass = max(abs(one.mass - 1) for one in values)
    smooth, sharp = (
        max(one.kl for one in values if (one.target == "checkerboard") is there)
        for there in (False, True)
    )
    return Findings(
        "agrees in part" if better == len(cells) else "differs",
        f"Our divergences are smaller in {better} of the six cells of the paper's table. They are "
        f"at most {smooth:.3f} for the Gaussians and {sharp:.3f} for the checkerboard, whose "
        f"edges no smooth density has. Every density integrates to 1 within {tiny(mass)}. "
        f"{extent.points:,} samples each, at most {extent.evaluations} evaluations of the "
        "likelihood, KL by quadrature at doubled steps.",
        "That the method works agrees; the printed numbers are those of fits that had not "
        f"succeeded. For {' and '.join(worse)} the KL is larger than that of the even density, "
        f"which knows nothing of the data: log 25/13 = {uniform['checkerboard']:.3f}. For six "
        f"Gaussians {uniform['6-gaussian']:.2f} is there to gain, of which the paper's fits have "
        f"{100 * gained[0]:.0f} and {100 * gained[1]:.0f} %. Ours have splines for fields, a "
        "start in closed form, an exact trace in place of an adjoint, and a base that is "
        "invariant under the group.",
        numbers={
            "kl": {f"{one.space}, {one.target}, {one.measure}": one.kl for one in values},
            "uniform": uniform,
            "mass_error": mass,
        },
        tables=[Table("KL divergence from the target, nats: the paper's, and ours.", heads, rows)],
    )  # fmt: skip


def _draw_flat(name: str, canvas: Canvas, _extent: Extent, values: list[Fitted]) -> Findings:
    figure = canvas.figure(0.445)
    torus = make_space("torus")
    top = float(target(name, midpoints(torus, 120)).max())
    errors = []
    for column, one in enumerate(values):
        density = one.density()
        box = _box(0, column)
        axes = figure.add_axes(box)
        _image(axes, square_values(density, 160), top)
        caption(figure, box, TITLES[one.space], weight="bold")
        style = {"ha": "center", "va": "top", "fontsize": 0.85 * text_size(figure), "color": INK}
        axes.text(0.5, -0.025, f"KL {one.kl:.4f}", transform=axes.transAxes, **style)
        axes = plane_axes(figure, _HALF_WINDOW, box=_box(1, column))
        field = functools.partial(mean_field, density)
        draw_magnitude(axes, field, _HALF_WINDOW)
        draw_flow(axes, field, density.space.group, _HALF_WINDOW)
        draw_cells(axes, density.space.group, _HALF_WINDOW)
        errors.append(equivariance_error(field, density.space.group.cosets))
    axes = figure.add_axes(_box(0, 4))
    _image(axes, target(name, midpoints(torus, 240)).reshape(240, 240).numpy(), top)
    caption(figure, _box(0, 4), "target", weight="bold")
    for row, text in enumerate(("density", "flow")):
        box = _box(row, 0)
        label(figure, 0.018, box[1] + box[3] / 2, text, rotation=90)
    canvas.add(
        figure,
        f"Above the density estimated for {NAMES[name]} on torus, sphere, Klein bottle and "
        "projective plane, and the target; below the flow fields with the letter F in every cell.",
        "Above: density per area of the square, dark is low. Below: mean of the flow's fields "
        "over time, colour its speed; the canonical square outlined, F in each of its images.",
    )
    return Findings(
        "agrees" if max(errors) < 1e-6 else "differs",
        f"The flows have the symmetry of their spaces to {tiny(max(errors))} of their size: on "
        "the sphere quarter turns about the corners, on Klein bottle and projective plane "
        "glides. KL divergences "
        + ", ".join(f"{one.kl:.4f} ({TITLES[one.space]})" for one in values) + ".",
        numbers={
            "kl": {one.space: one.kl for one in values},
            "symmetry_error": dict(zip(SPACES, errors, strict=True)),
        },
    )  # fmt: skip


def _image(axes: Axes, values: Array, top: float) -> None:
    square = {"origin": "lower", "extent": (0, 1, 0, 1), "interpolation": "bilinear"}
    axes.imshow(values.T, cmap=COLOURS, vmin=0, vmax=top, **square)
    axes.set_axis_off()


TABLE = Exhibit(
    "table-5",
    "KL divergence of estimated densities",
    "KL divergence between target and estimated distribution. Torus: 0.03, 0.45, 0.67; sphere: "
    "0.03, 0.47, 0.56, for 4 Gaussians, 6 Gaussians and the 5 × 5 checkerboard. The results "
    "demonstrate the effectiveness of the methodology.",
    _draw_table,
    _needs_table,
)
SIX_GAUSSIANS = Exhibit(
    "figure-10",
    "Density estimation: six Gaussians",
    "The densities estimated for a mixture of six Gaussians on torus, sphere, Klein bottle and "
    "projective plane, black where probability is low; the flow fields clearly show the symmetry "
    "of each space.",
    functools.partial(_draw_flat, "6-gaussian"),
    lambda extent: [fit_work(space, "6-gaussian", extent) for space in SPACES],
)
CHECKERBOARD = Exhibit(
    "figure-12",
    "Density estimation: the checkerboard",
    "The same for a 5 × 5 checkerboard on the four spaces.",
    functools.partial(_draw_flat, "checkerboard"),
    lambda extent: [fit_work(space, "checkerboard", extent) for space in SPACES],
)

EMBEDDED = ("torus", "sphere")
TORUS_TURN = (3.9, 0.85)  # from where the ring is seen; spheres have their highest density in front


def _draw_surfaces(canvas: Canvas, extent: Extent, values: list[Any]) -> Findings:
    from matplotlib import colormaps

    figure = canvas.figure(0.66)
    pages = {}
    for k, one in enumerate(values):
        row, column = divmod(k, len(TARGETS))
        density = one.density()
        # the chart of the sphere stretches the middle of the square
        finer = 1.0 if one.space == "torus" else 1.5
        n = round(finer * extent.resolution)
        shown = square_values(density, n)
        top = float(np.quantile(shown, 0.998))
        box = grid_box(row, column, 2, 3, title=0.02, gap=0.0, left=0.04, top=0.05)
        axes = figure.add_axes(box)
        colours = colormaps[COLOURS](np.clip(shown / top, 0, 1))[..., :3]
        highest = (torch.tensor(divmod(int(shown.argmax()), n), dtype=torch.float64) + 0.5) / n
        seen = viewpoint(density.space, highest)
        turn = TORUS_TURN if one.space == "torus" else (seen.yaw, seen.pitch)
        draw_surface(axes, density.space, colours, turn)
        if row == 0:
            caption(figure, box, NAMES[one.target], weight="bold")
        if column == 0:
            name = TITLES[one.space]
            label(figure, 0.02, box[1] + box[3] / 2, name, rotation=90, weight="bold")
        title = f"{NAMES[one.target]} on the {TITLES[one.space]}"
        settings = PlotSettings(measure="square", scale="linear")
        pages[f"{one.space}-{one.target}"] = density_page(
            density, settings, resolution=min(extent.resolution, 120), title=title
        )
    canvas.add(
        figure,
        "Two rows of three surfaces: rings above, spheres below, coloured by densities of four "
        "Gaussians, six Gaussians and a checkerboard.",
        "Colour: density per area of the square, as the targets are given. To turn them yourself:",
        pages=pages,
        exact=True,
    )
    return Findings(
        "agrees",
        "The standard embeddings, coloured by the estimated densities: the colours close over "
        "the seams, since the densities are invariant under the group.",
        "On the sphere these colours are a texture, not the density of points on it: the "
        "square's area is not the sphere's, and per round area the density grows without bound "
        "towards the three places that the square's corners become. A density on the sphere is "
        "one with respect to its area; Table 5 has fits of that kind, too.",
        numbers={f"{one.space}, {one.target}": one.kl for one in values},
    )  # fmt: skip


SURFACES = Exhibit(
    "figure-11",
    "Densities on torus and sphere, in space",
    "The densities estimated on torus and sphere with the standard embedding, for 4 Gaussians, 6 "
    "Gaussians and the 5 × 5 checkerboard.",
    _draw_surfaces,
    lambda extent: [fit_work(space, name, extent) for space in EMBEDDED for name in TARGETS],
)
