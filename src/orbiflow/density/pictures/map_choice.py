"""The map that suits a round space and the points drawn on it, and its caption."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import cast

import numpy as np
from torch import Tensor

from orbiflow.arrays import Array
from orbiflow.density.pictures.axes import degrees_text
from orbiflow.density.pictures.map_axes import graticule
from orbiflow.density.pictures.projections import (
    Azimuthal,
    EqualEarth,
    Lambert,
    Mollweide,
    PlateCarree,
    Projection,
    Stereographic,
    WorldMap,
)
from orbiflow.density.pictures.settings import PlotSettings
from orbiflow.density.spaces import RoundSpace, Space, to_latlon, to_vectors
from orbiflow.errors import OrbiflowError, SettingError

WORLD: dict[str, type[WorldMap]] = {c.name: c for c in (EqualEarth, Mollweide, PlateCarree)}
CENTRED: dict[str, type[Azimuthal]] = {c.name: c for c in (Lambert, Stereographic)}
NETS: dict[str, type[Azimuthal]] = {"schmidt": Lambert, "wulff": Stereographic}
"""Nets of structural geology: latitude is plunge or inclination, longitude trend or declination."""

_NET_WORDS = ("inc", "plunge", "dip")
"""How names of the first column begin if rows are directions in a net, not places on a globe."""

_RADII = (5, 10, 15, 20, 30, 40, 50, 60, 75)
_SHARE = 0.995
"""Share of the points that a map of less than the sphere has to show."""


def chosen_map(
    space: Space,
    points: Tensor,
    settings: PlotSettings | None = None,
    names: Sequence[str] | None = None,
) -> Projection:
    """Return the map of a sphere or projective plane that settings ask for, or that suits points.

    `points` are chart points (N, 2); `names` of the data's columns may ask for a net.

    >>> from orbiflow.density import Sphere
    >>> here = Sphere().to_chart([[40.0, 140.0], [44.0, 142.0]])
    >>> chosen_map(Sphere(), here)
    Lambert(center=(42.0, 141.0), radius=5.0, flipped=False)
    """
    if not space.is_round:
        raise OrbiflowError(f"maps are of the sphere and the projective plane, not of {space!r}")
    settings = settings or PlotSettings()
    projection, radius = settings.projection, settings.radius
    middle = None if settings.center is None else _checked_center(settings.center)
    axial = space.name == "projective-plane"
    cap = None if axial else smallest_cap(cast(RoundSpace, space).vectors(points))
    if projection == "auto":
        if axial:
            projection = "schmidt" if _name_a_net(names) and middle is None else "lambert"
        elif middle is not None:
            projection = "lambert" if len(middle) == 2 and middle[0] else "equal-earth"
        else:
            projection = "equal-earth" if cap is None and radius is None else "lambert"
    if projection in WORLD:
        return _world(WORLD[projection], space, middle, radius)
    if projection in NETS:
        if middle is not None:
            raise SettingError(
                f"{{center}} does not apply to a {projection} net, which has the vertical in its "
                "middle: give no centre"
            )
        return NETS[projection]((90.0, 0.0), float(radius or 90.0), flipped=True)
    return _centred(CENTRED[projection], middle, radius, axial, cap)


def smallest_cap(vectors: Array) -> tuple[tuple[float, float], float] | None:
    """Return a centre in whole degrees, and a radius that shows nearly all unit vectors (N, 3).

    It is None if they do not fit into 75 degrees around a centre.
    """
    mean = vectors.mean(axis=0) if len(vectors) else np.zeros(3)
    if np.linalg.norm(mean) < 0.2:
        return None
    lat, lon = to_latlon(mean[None] / np.linalg.norm(mean))[0].round() + 0.0
    middle = to_vectors([[lat, lon]])[0]
    apart = np.degrees(np.arccos(np.clip(vectors @ middle, -1, 1)))
    reach = 1.1 * float(np.quantile(apart, _SHARE, method="higher"))
    fitting = [float(r) for r in _RADII if r >= reach]
    return ((float(lat), float(lon)), fitting[0]) if fitting else None


def _world(
    kind: type[WorldMap], space: Space, middle: tuple[float, ...] | None, radius: float | None
) -> Projection:
    if space.name == "projective-plane":
        raise SettingError(
            "a direction and its opposite are one point of the projective plane, which needs a map "
            f"of one hemisphere: {{projection}} must be {', '.join((*CENTRED, *NETS))}, got {kind.name}"
        )
    if radius is not None:
        raise SettingError(
            f"a map of the whole sphere ({kind.name}) has no radius: leave {{radius}} out"
        )
    middle = middle or (0.0,)
    return kind(middle if len(middle) == 2 else (0.0, middle[0]))  # pyright: ignore[reportArgumentType]


def _centred(
    kind: type[Azimuthal],
    middle: tuple[float, ...] | None,
    radius: float | None,
    axial: bool,
    cap: tuple[tuple[float, float], float] | None,
) -> Projection:
    if middle is None:
        middle, reach = cap or ((90.0, 0.0), 90.0)
    else:
        reach = 90.0
        if len(middle) == 1:
            middle = (90.0 if axial else 0.0, middle[0])
    return kind((middle[0], middle[1]), float(radius or reach))


def _checked_center(center: Sequence[float]) -> tuple[float, ...]:
    values = tuple(float(value) for value in center)
    if len(values) not in (1, 2) or not all(map(math.isfinite, values)):
        raise SettingError(
            "{center} must be a latitude and a longitude, or a longitude, in degrees, such as 40,140, "
            f"got {list(center)}"
        )
    return values


def _name_a_net(names: Sequence[str] | None) -> bool:
    return bool(names) and names is not None and names[0].strip().lower().startswith(_NET_WORDS)


def subtitle(projection: Projection) -> str:
    """Return the projection as a title has it."""
    if _is_net(projection):
        return "Schmidt net (equal-area)" if projection.is_equal_area else "Wulff net (equal-angle)"
    return projection.title


def caption(
    space: Space,
    projection: Projection,
    notes: Sequence[str] = (),
    *,
    dots: tuple[int, int] | None = None,
    coastlines: bool = False,
) -> str:
    """Return a map's caption: projection, centre, which points are one, lines and dots, and notes.

    >>> from orbiflow.density import Sphere
    >>> from orbiflow.density.pictures.projections import Mollweide
    >>> caption(Sphere(), Mollweide((0.0, 150.0)))
    'The sphere in the Mollweide projection (equal-area), about 150° E. Lines every 30°.'
    """
    parts = [_description(space, projection)]
    if space.name == "projective-plane":
        parts.append(
            "An axis is drawn at the end in this hemisphere; opposite points of the rim are one axis"
        )
    lats, lons = graticule(projection)
    steps = {f"{line[1] - line[0]:g}°" for line in (lats, lons) if len(line) > 1}
    steps = sorted(steps, key=lambda text: float(text[:-1]))
    lines = f"Lines every {steps[0]}"
    if len(steps) > 1:
        lines = f"Parallels every {lats[1] - lats[0]:g}°, meridians every {lons[1] - lons[0]:g}°"
    parts.append(lines + (", and coastlines" if coastlines else ""))
    if dots is not None:
        shown, known = dots
        parts.append(f"Dots are {f'{shown} of ' if shown < known else ''}{known} points")
    parts += [note[0].upper() + note[1:] for note in notes]
    return " ".join(f"{part}." for part in parts)


def _description(space: Space, projection: Projection) -> str:
    lat, lon = projection.center
    frame = (
        ""
        if space.columns[0] == "lat"
        else "; latitudes are from the x, y plane towards z, longitudes from x towards y"
    )
    if not isinstance(projection, Azimuthal):
        middle = degrees_text((lon + 180) % 360 - 180, "EW")
        return f"The sphere in {projection.title}, about {middle}{frame}"
    within = (
        "the hemisphere" if projection.radius == 90 else f"what is within {projection.radius:g}°"
    )
    if _is_net(projection):
        return (
            f"Lower hemisphere, {subtitle(projection)}: the vertical (latitude, plunge or inclination "
            "90°) is in the middle, longitude (trend, declination) runs clockwise from the top"
        )
    if abs(lat) == 90:
        where = "the north pole" if lat > 0 else "the south pole"
    else:
        where = f"{degrees_text(lat, 'NS')}, {degrees_text((lon + 180) % 360 - 180, 'EW')}"
    seen = f"about {where} in {projection.title}, seen from outside{frame}"
    return f"{within[0].upper()}{within[1:]} {seen}"


def _is_net(projection: Projection) -> bool:
    return isinstance(projection, Azimuthal) and projection.flipped
