"""Pictures of textures: pole figures, inverse pole figures and sections through Euler space."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.inference import pole_density, rotations_only
from orbiflow.density.models import Density
from orbiflow.density.pictures import frames
from orbiflow.density.pictures.colours import bar_ticks, is_sharp, round_pixel, shading
from orbiflow.density.pictures.grounds import MAX_DOTS, Colouring, draw_dots_over
from orbiflow.density.pictures.projections import Azimuthal, Lambert, Stereographic
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import (
    HEXAGONAL,
    RotationSpace,
    fundamental_sector,
    indices_of,
    international_name,
    plane_normal,
    specimen_direction,
    to_latlon,
    to_vectors,
)
from orbiflow.drawing import Picture, Sheet
from orbiflow.errors import SettingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LABEL = "multiples of a random texture"
ACROSS, INVERSE_ACROSS = 101, 61
"""Pixels across a pole figure, and an inverse one."""

SECTION_STEP = 1.5
"""Degrees between the pixels of a section."""

UPWARDS = (90.0, -90.0)
"""Centre of a hemisphere with x to the right and y upwards."""

MOST_PANELS = 12
"""The most pole figures or sections in a picture."""

_NETS: dict[str, type[Azimuthal]] = {
    **dict.fromkeys(("auto", "lambert", "schmidt"), Lambert),
    **dict.fromkeys(("stereographic", "wulff"), Stereographic),
}


class Panel(NamedTuple):
    """A panel: values on even pixels, the lowest row first, and what is around them.

    - `extent`: Left, right, bottom and top of the pixels on the axes.
    - `outline`: Ring (N, 2) around what is shown, None for the whole rectangle.
    - `texts`: Places on the axes, with the texts that stand outside there.
    - `dots`: Places (M, 2) of data.
    """

    head: str
    values: Array
    extent: tuple[float, float, float, float]
    outline: Array | None = None
    texts: tuple[tuple[float, float, str], ...] = ()
    dots: Array | None = None


def check_texture(space: RotationSpace, settings: PlotSettings) -> None:
    """Check that settings of a texture fit its space."""
    if settings.projection not in _NETS:
        raise SettingError(
            f"{{projection}} of a pole figure must be schmidt or lambert (equal areas) or wulff or "
            f"stereographic (equal angles), got {settings.projection}"
        )
    others = {
        "center": settings.center,
        "radius": settings.radius,
        "coastlines": settings.coastlines,
    }
    for name, value in others.items():
        if value is not None:
            raise SettingError(f"{{{name}}} applies to maps and tori, not to the {space.name}")
    if settings.lattice is not None and len(settings.lattice) != 3:
        raise SettingError("{lattice} must be three lengths a,b,c, such as 1,1,1.587")
    for given, what in ((settings.pole, "pole"), (settings.inverse, "inverse")):
        if len(given or ()) > MOST_PANELS:
            raise SettingError(f"{{{what}}} must be at most {MOST_PANELS} directions")
    if len(settings.sections or ()) > MOST_PANELS:
        raise SettingError(f"{{sections}} must be at most {MOST_PANELS} angles")
    _poles(space, settings)
    _specimen_ways(settings)


def _poles(space: RotationSpace, settings: PlotSettings) -> dict[str, Array]:
    """Return the normals of the planes whose poles are drawn, by their indices."""
    wanted = settings.pole
    if wanted is None:
        wanted = ("0001", "10-10") if space.symmetry in HEXAGONAL else ("001", "110", "111")
        if space.symmetry not in ("T", "O") and space.symmetry not in HEXAGONAL:
            wanted = ("001", "100", "010")
    found: dict[str, Array] = {}
    for text in wanted:
        indices = indices_of(text)
        found[_barred("".join(map(str, indices)))] = plane_normal(
            indices, space.symmetry, settings.lattice
        )
    return found


def _specimen_ways(settings: PlotSettings) -> dict[str, Array]:
    return {text: specimen_direction(text) for text in settings.inverse or ("x", "y", "z")}


@torch.no_grad()
def poles_picture(
    density: Density, points: Tensor | None, settings: PlotSettings, *, sheet: Sheet | None = None
) -> Picture:
    """Draw pole figures: how often normals of lattice planes lie along directions of the specimen.

    Args:
        density: A density on a space of rotations.
        points: Orientations (N, 4) whose poles are drawn as dots.
        settings: How they are drawn.
        sheet: The sheet. Default: that of the settings.
    """
    space, net = rotations_only(density), _NETS[settings.projection](UPWARDS)
    smooth, note = _averaged(density, math.pi / (2 * ACROSS))
    places, extent = _pixels(net.outline(), ACROSS)
    ways = to_vectors(net.inverse(_within(places, net.rim)))
    panels, error = list[Panel](), 0.0
    for name, normal in _poles(space, settings).items():
        values, off = pole_density(smooth, normal, ways)
        error = max(error, off)
        dots = None if points is None else net.forward(to_latlon(_pole_dots(space, points, normal)))
        texts = ((net.rim, 0.0, "x"), (0.0, net.rim, "y"))
        head = f"{{{name}}}   {values.min():.2g} to {values.max():.3g}"
        table = values.reshape(ACROSS, ACROSS)
        panels.append(Panel(head, table, extent, net.outline(), texts, dots))
    words = [
        f"The upper hemisphere in {net.title}, x to the right, y upwards, z in the middle",
        "Opposite poles are one",
        *_notes(space, note, error),
    ]
    return _picture("Pole figures", panels, words, settings, sheet or settings.sheet)


@torch.no_grad()
def inverse_picture(
    density: Density, points: Tensor | None, settings: PlotSettings, *, sheet: Sheet | None = None
) -> Picture:
    """Draw inverse pole figures: which directions of the crystal lie along some of the specimen.

    They are drawn in the crystal's fundamental sector. Arguments are those of `poles_picture`.
    """
    space, net = rotations_only(density), _NETS[settings.projection](UPWARDS)
    smooth, note = _averaged(density, math.pi / (4 * INVERSE_ACROSS))
    sector = fundamental_sector(space.symmetry)
    outline = net.outline() if sector.whole else _edge(net, sector.corners)
    places, extent = _pixels(outline, INVERSE_ACROSS)
    ways = to_vectors(net.inverse(_within(places, net.rim)))
    corners = net.forward(to_latlon(sector.corners)) if len(sector.corners) else np.zeros((0, 2))
    middle = outline.mean(axis=0)
    texts = tuple(
        (float(x), float(y), _barred(label))
        for (x, y), label in zip(corners, sector.labels, strict=True)
    )
    panels, error = list[Panel](), 0.0
    for name, way in _specimen_ways(settings).items():
        turned, off = pole_density(smooth, ways, way)
        error = max(error, off)
        dots = None
        if points is not None:
            dots = _sector_dots(space, points, way, net, middle)
        head = f"{name}   {turned.min():.2g} to {turned.max():.3g}"
        panels.append(Panel(head, turned.reshape(INVERSE_ACROSS, -1), extent, outline, texts, dots))
    where = "the upper hemisphere" if sector.whole else "the fundamental sector"
    words = [
        f"The crystal's directions along those of the specimen, in {where}, in {net.title}",
        "Opposite directions are one",
        *_notes(space, note, error),
    ]
    return _picture("Inverse pole figures", panels, words, settings, sheet or settings.sheet)


@torch.no_grad()
def sections_picture(
    density: Density, points: Tensor | None, settings: PlotSettings, *, sheet: Sheet | None = None
) -> Picture:
    """Draw sections through the space of Bunge's angles at some phi2: phi1 to the right, Phi downwards.

    Arguments are those of `poles_picture`, but that no points are drawn.
    """
    del points
    space = rotations_only(density)
    smooth, note = _averaged(density, math.radians(SECTION_STEP) / 2)
    widest, deepest = _euler_ends(space)
    phi1 = np.arange(SECTION_STEP / 2, widest, SECTION_STEP)
    big_phi = np.arange(SECTION_STEP / 2, deepest, SECTION_STEP)
    panels: list[Panel] = []
    for phi2 in settings.sections or (0.0, 45.0, 65.0):
        grid: Any = np.stack(np.meshgrid(phi1, big_phi[::-1]), axis=-1).reshape(-1, 2)
        angles = np.column_stack([grid, np.full(len(grid), phi2)])
        turns = torch.tensor(Rotation.from_euler("ZXZ", angles, degrees=True).as_quat())
        values = smooth.log_prob(turns, measure="uniform").exp().numpy()
        head = f"phi2 = {phi2:g}\u00b0   {values.min():.2g} to {values.max():.3g}"
        table = values.reshape(len(big_phi), len(phi1))
        panels.append(Panel(head, table, (0.0, widest, deepest, 0.0)))
    words = ["phi1 to the right, Phi downwards, in degrees", *_notes(space, note, 0.0)]
    return _picture("Sections", panels, words, settings, sheet or settings.sheet)


def _euler_ends(space: RotationSpace) -> tuple[float, float]:
    """Return where phi1 and Phi end in a section: by turns about z, and by half turns across it."""
    about, across = 0, [False, False]
    for turn in space.specimen_rotations.as_matrix():
        about += bool(turn[2, 2] > 1 - 1e-9)
    for side, group in enumerate((space.specimen_rotations, space.crystal_rotations)):
        across[side] = bool((group.as_matrix()[:, 2, 2] < -1 + 1e-9).any())
    # one half turn across brings Phi below 90, a second one halves phi1
    return 360.0 / about / (2 if all(across) else 1), 90.0 if any(across) else 180.0


def _barred(label: str) -> str:
    """Return Miller indices with bars over what is negative.

    >>> _barred("1-10") == "11\u03040"
    True
    """
    return "".join(
        f"{part[1:]}\u0304" if part.startswith("-") else part for part in re.findall(r"-?\d", label)
    )


def _averaged(density: Density, pixel: float) -> tuple[Density, str]:
    """Return a density averaged over pixels of so many radians of quaternions, and a note if it is."""
    side = round_pixel(pixel)
    sharp = is_sharp(density, side)
    smooth = density.averaged_over(side) if sharp else density
    return smooth, "Peaks narrower than a pixel are averaged over it" if sharp else ""


def _notes(space: RotationSpace, averaged: str, error: float) -> list[str]:
    names = [international_name(own) for own in (space.symmetry, space.specimen)]
    found = [f"Crystals {names[0]}, specimen {names[1]}", averaged]
    found.append(f"Integrals along fibres are right within {error:.1g}" if error else "")
    return [note for note in found if note]


def _pixels(ring: Array, across: int) -> tuple[Array, tuple[float, float, float, float]]:
    """Return the middles (N, 2) of even pixels over what a ring encloses, rows upwards, and their ends.

    There are `across` of them along each side.
    """
    low, high = ring.min(axis=0), ring.max(axis=0)
    lines = [low[k] + (high[k] - low[k]) * (np.arange(across) + 0.5) / across for k in (0, 1)]
    grid: Any = np.stack(np.meshgrid(*lines), axis=-1).reshape(-1, 2)
    return grid, (float(low[0]), float(high[0]), float(low[1]), float(high[1]))


def _within(places: Array, rim: float) -> Array:
    """Return places (N, 2), those beyond the rim drawn back to it."""
    distance = np.linalg.norm(places, axis=1, keepdims=True)
    return places * np.minimum(1.0, rim * (1 - 1e-9) / np.maximum(distance, 1e-12))


def _edge(net: Azimuthal, corners: Array) -> Array:
    """Return the ring (N, 2) around a sector: great circles between its corners."""
    places: list[Array] = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        t = np.linspace(0, 1, 60)[:, None]
        line = (1 - t) * start + t * end
        places.append(net.forward(to_latlon(line / np.linalg.norm(line, axis=1, keepdims=True))))
    return np.concatenate(places)


def _pole_dots(space: RotationSpace, points: Tensor, normal: Array) -> Array:
    """Return all directions (N, 3), in the upper hemisphere, of a crystal's planes in orientations."""
    every = space.crystal_rotations.apply(normal)
    every = np.unique(np.concatenate([every, -every]).round(9), axis=0)
    shown = points[:MAX_DOTS].numpy()
    turned = [Rotation.from_quat(shown).apply(own) for own in every]
    both = np.concatenate([left.apply(own) for left in space.specimen_rotations for own in turned])
    return both[both[:, 2] >= 0]


def _sector_dots(
    space: RotationSpace, points: Tensor, way: Array, net: Azimuthal, middle: Array
) -> Array:
    """Return places of the crystal's directions along one of the specimen, in the sector."""
    crystal = Rotation.from_quat(points.numpy()).inv().apply(way)
    images = np.stack([turn.apply(crystal) for turn in space.crystal_rotations])
    images = np.concatenate([images, -images])
    about = to_vectors(net.inverse(middle[None]))[0]
    upper = np.where(images[..., 2] >= -1e-12, images @ about, -np.inf)
    best = np.take_along_axis(images, upper.argmax(axis=0)[None, :, None], axis=0)[0]
    return net.forward(to_latlon(best))


MOST_ACROSS, LEAST_EMS, WIDE = 3, 15.0, 0.5
"""Panels side by side at most, the ems that each takes at least, and height over width of those that
are too wide to lie side by side."""


def _picture(
    title: str, panels: Sequence[Panel], words: Sequence[str], settings: PlotSettings, sheet: Sheet
) -> Picture:
    """Lay panels out in rows beside the bar of their common colours."""
    every = np.concatenate([panel.values.ravel() for panel in panels])
    log = None if settings.scale == "auto" else settings.scale == "log"
    shade = shading(every, log=log)
    scale = "logarithmic" if shade.log else "linear"
    caption = frames.sentences([*words, f"Colours are {scale}, the same in all panels"])
    left, right, top, bottom = panels[0].extent
    shape = abs(bottom - top) / abs(right - left)
    is_plain = panels[0].outline is None
    gap, above = (3.4 if is_plain else 4.2) * sheet.em, (4.2 if is_plain else 3.8) * sheet.em
    room = frames.Room(4.2 if is_plain else 2.4, 2.6, 1.6, 0.4, 2.0, 1.2)
    room = frames.room_for_bar_beside(sheet, room, LABEL, [tick.text for tick in bar_ticks(shade)])
    if not sheet.printed:
        room = room._replace(above=2.6).with_words(caption, sheet)
    inner = sheet.width - sheet.em * (room.left + room.right)
    columns = max(1, min(MOST_ACROSS, len(panels), int(inner / (LEAST_EMS * sheet.em))))
    columns = 1 if shape < WIDE else columns
    rows = -(-len(panels) // columns)
    side = (inner - (columns - 1) * gap) / columns
    side = side if shape < WIDE else min(side, 0.5 * sheet.width)
    high = side * shape
    figure = sheet.figure(rows * (high + above) + sheet.em * (room.above + room.below))
    base, image = sheet.em * room.below, None
    for number, panel in enumerate(panels):
        row, column = divmod(number, columns)
        x = sheet.em * room.left + column * (side + gap)
        axes = frames.axes_at(figure, x, base + (rows - 1 - row) * (high + above), side, high)
        colouring = Colouring(
            shade.places(panel.values), panel.extent, shade, "", "", None, panel.outline
        )
        image = colouring.draw(axes)
        _decorate(axes, panel, sheet, side)
    assert image is not None
    right = sheet.em * (room.left + room.gap) + columns * side + (columns - 1) * gap
    total = rows * high + (rows - 1) * above
    bar = frames.axes_at(figure, right, base, sheet.em * room.bar, total)
    frame = frames.Frame(figure, bar, bar, total)
    frames.colour_bar(image, frame, sheet, LABEL, shade)
    if not sheet.printed:
        frames.write_caption(figure, caption, sheet)
        height = figure.get_size_inches()[1]
        size = 1.15 * sheet.text
        figure.text(
            0.5, 1 - 1.6 * sheet.em / height, title, ha="center", va="center", fontsize=size
        )
    return Picture(figure, sheet, title, caption)


def _decorate(axes: Axes, panel: Panel, sheet: Sheet, side: float) -> None:
    """Draw the outline of a panel, its head, and its texts or ticks."""
    left, right, low, high = panel.extent
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_title(
        panel.head,
        fontsize=sheet.text,
        pad=(0.6 if panel.outline is None else 1.5) * sheet.text,
        parse_math=False,
    )
    if panel.outline is None:
        axes.tick_params(labelsize=sheet.small, width=sheet.pen(0.8), length=0.3 * sheet.text)
        for along, axis in ((right - left, axes.xaxis), (low - high, axes.yaxis)):
            axis.set_ticks(np.arange(0, along + 1, 30 if along <= 180 else 90).tolist())
        return
    axes.set_axis_off()
    pen = sheet.pen(1.2, 0.4)
    axes.plot(*panel.outline.T, color=frames.INK, linewidth=pen, clip_on=False, zorder=7)
    middle = np.array([(left + right) / 2, (low + high) / 2])
    for x, y, text in panel.texts:
        way = np.array([x, y]) - middle
        way /= max(float(np.linalg.norm(way)), 1e-9)
        axes.annotate(
            text, (x, y), xytext=tuple(0.8 * sheet.small * way), textcoords="offset points",
            ha="center", va="center", fontsize=sheet.small, color=frames.INK, annotation_clip=False,
        )  # fmt: skip
    if panel.dots is not None and len(panel.dots):
        scale = max(0.2, (side / 5.6) ** 2)
        width = side / (right - left)
        draw_dots_over(axes, panel.dots, width, limit=MAX_DOTS, scale=scale)
