"""A tile lies in the same place whether it is cut, printed or painted."""

from typing import Any

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from artworks import art_settings, squirrel, upside_down
from orbiflow.drawing import palette, rgb
from orbiflow.tiles import (
    CLASSES,
    ArtSettings,
    ExportSettings,
    Uses,
    artwork,
    render_artwork,
    scenes,
)
from orbiflow.tiles.make import Artwork, art_scene
from refusals import refused

PAGE: dict[str, Any] = {"area": "211.7x148mm", "tile_size": "37mm"}


def painted_rings(art: Artwork) -> np.ndarray:
    """The tiles (M, N, 2) of artwork in mm."""
    scene = art_scene(art)
    fills = [item for layer in scene.layers for item in layer.items if layer.style.fill]
    return np.concatenate(
        [
            uses.images(scene.symbols["tile"].pieces[:, 0])
            for uses in fills
            if isinstance(uses, Uses)
        ]
    )


def cut_rings(tile: Any, **settings: Any) -> np.ndarray:
    """The tiles (M, N, 2) of an export in mm."""
    (scene,), _ = scenes(tile, ExportSettings(**settings))
    assert scene.prototiles
    return np.stack([scene.prototiles[0] @ one.linear.T + one.offset for one in scene.tiles])


def apart(some: np.ndarray, others: np.ndarray) -> float:
    """How far each of some tiles is from the nearest other, at most, in mm."""
    gaps = np.abs(some[:, None] - others[None]).max(axis=(2, 3))
    return float(gaps.min(axis=1).max())


@settings(max_examples=3)
@given(
    st.sampled_from(list(CLASSES)),
    st.booleans(),
    st.booleans(),
    st.floats(-360, 360),
    st.sampled_from(["skeleton", "none"]),
    st.sampled_from(["laser", "print", None]),
)
def test_art_and_export_put_tiles_in_the_same_places(
    name: str, turned: bool, clip: bool, rotate: float, cut: str, purpose: str | None
) -> None:
    tile = upside_down(squirrel(name)) if turned else squirrel(name)
    same: dict[str, Any] = {"rotate": rotate, "clip": clip}
    painted = painted_rings(artwork(tile, ArtSettings(**PAGE, **same)))
    found = cut_rings(tile, **PAGE, **same, cut=cut, purpose=purpose)
    assert apart(found, painted) < 1e-6
    page = shapely.box(0, 0, 211.7, 148)
    shown = [page.intersects(one) for one in np.asarray(shapely.polygons(painted))]
    assert apart(painted[shown], found) < 1e-6


def test_whole_tiles_alone_are_painted() -> None:
    art = artwork(squirrel("IH6"), ArtSettings(**PAGE, clip=False, dpi=60))
    rings = painted_rings(art)
    assert rings.min() > 0
    assert (rings < (211.7, 148)).all()
    assert art.shown == len(rings)
    # on the paper of the palette, nothing but these tiles
    pixels = np.asarray(render_artwork(art))[2::8, 2::8]
    rows, columns = np.indices(pixels.shape[:2]) * 8 + 2.5
    region = shapely.union_all(np.asarray(shapely.polygons(rings))).buffer(0.4)
    inside = shapely.contains_xy(region, columns * 25.4 / 60, rows * 25.4 / 60)
    on_paper = (pixels == rgb(palette("earth").paper)).all(axis=2)
    assert on_paper[~inside].all()
    assert not on_paper[inside].all()
    with refused("2500 x 1748 pixels"):
        artwork(squirrel("IH6"), ArtSettings(**{**PAGE, "tile_size": "25cm", "clip": False}))


def test_the_cell_that_repeats_is_neither_turned_nor_whole() -> None:
    settings: list[dict[str, Any]] = [{"rotate": 10.0}, {"clip": False}]
    for setting in settings:
        with refused("repeat"):
            art_settings(repeat="basic", **setting)
