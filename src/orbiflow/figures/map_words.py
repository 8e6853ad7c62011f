"""What a map shows, in words: for the caption in print, and below the map on a screen."""

from __future__ import annotations

from collections.abc import Sequence

from orbiflow.density.spaces.space import Space
from orbiflow.figures.azimuthal import Azimuthal
from orbiflow.figures.density_axes import degrees
from orbiflow.figures.map_axes import graticule
from orbiflow.figures.projections import Projection


def subtitle(projection: Projection) -> str:
    """The projection in a title."""
    if _is_net(projection):
        return "Schmidt net (equal-area)" if projection.is_equal_area else "Wulff net (equal-angle)"
    return projection.title


def caption(
    space: Space,
    projection: Projection,
    notes: Sequence[str] = (),
    *,
    dots: tuple[int, int] | None = None,
    coasts: bool = False,
) -> str:
    """Projection, centre, what is one point, what lines and dots are; then `notes`.

    Args:
        dots: how many are drawn, and of how many points.

    >>> from orbiflow.density.spaces.round import Sphere
    >>> from orbiflow.figures.world_maps import Mollweide
    >>> caption(Sphere(), Mollweide((0.0, 150.0)))
    'The sphere in the Mollweide projection (equal-area), about 150° E. Lines every 30°.'
    """
    parts = [_projected(space, projection)]
    if space.name == "projective-plane":
        parts.append(
            "An axis is drawn at the end in this hemisphere; opposite points of the rim are one axis"
        )
    lats, lons = graticule(projection)
    steps = {f"{line[1] - line[0]:g}°" for line in (lats, lons) if len(line) > 1}
    steps = sorted(steps, key=lambda text: float(text[:-1]))
    if len(steps) == 1:
        parts.append(f"Lines every {steps[0]}" + (", and coastlines" if coasts else ""))
    else:
        lines = f"Parallels every {lats[1] - lats[0]:g}°, meridians every {lons[1] - lons[0]:g}°"
        parts.append(lines + (", and coastlines" if coasts else ""))
    if dots is not None:
        shown, known = dots
        parts.append(f"Dots are {f'{shown} of ' if shown < known else ''}{known} points")
    parts += [note[0].upper() + note[1:] for note in notes]
    return " ".join(f"{part}." for part in parts)


def _projected(space: Space, projection: Projection) -> str:
    lat, lon = projection.center
    frame = (
        ""
        if space.columns[0] == "lat"
        else "; latitudes are from the x, y plane towards z, longitudes from x towards y"
    )
    if not isinstance(projection, Azimuthal):
        middle = degrees((lon + 180) % 360 - 180, "EW")
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
        where = f"{degrees(lat, 'NS')}, {degrees((lon + 180) % 360 - 180, 'EW')}"
    seen = f"about {where} in {projection.title}, seen from outside{frame}"
    return f"{within[0].upper()}{within[1:]} {seen}"


def _is_net(projection: Projection) -> bool:
    return isinstance(projection, Azimuthal) and projection.flipped
