"""The PNG pictures have their size and show what they should."""

import io
from typing import Any

import numpy as np
import pytest
import torch
from PIL import Image

from orbiflow.arrays import Array
from orbiflow.drawing import Sheet, field_picture, palette
from orbiflow.tiles import Tile, classes_png, isohedral_class, overlay_picture, tiling_picture
from orbiflow.tiles.pictures.overlays import ADDED, COMMON, MISSING
from refusals import refused


def pixels(data: bytes) -> Array:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def share(image: Array, colour: str) -> float:
    rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
    return float((np.abs(image.astype(int) - rgb).max(axis=-1) <= 2).mean())


@pytest.mark.parametrize("outline", [0.8, 0.0])
def test_tiling_fills_the_picture_with_its_colours(bent_tile: Any, outline: float) -> None:
    image = pixels(tiling_picture(bent_tile("IH7"), outline=outline / 216).png(600))
    assert image.shape == (400, 600, 3)
    chosen = palette("delft")
    shares = [share(image, chosen.fill(k)) for k in range(3)]
    assert all(0.2 < value < 0.45 for value in shares)
    assert share(image, chosen.paper) < 1e-3  # no seams
    assert sum(shares) > (0.9 if outline else 0.96)


def square(side: float, offset: float = 0.0) -> Array:
    return offset + side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def test_overlay_shows_missing_and_added_in_proportion() -> None:
    tile = Tile(square(1.0), isohedral_class("IH1").group(), "IH1")
    image = pixels(overlay_picture(tile, square(1.0) + np.array([0.25, 0.0])).png(800))
    common, missing, added = (share(image, colour) for colour in (COMMON, MISSING, ADDED))
    assert common / missing == pytest.approx(3.0, rel=0.05)
    assert added == pytest.approx(missing, rel=0.05)
    left = image[:, : image.shape[1] // 3]
    assert share(left[:500], ADDED) > 0.2
    assert share(left[:500], MISSING) == 0.0


def test_overlay_of_awkward_targets() -> None:
    tile = Tile(square(1.0), isohedral_class("IH1").group())
    bow_tie = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    assert share(pixels(overlay_picture(tile, bow_tie).png(400)), ADDED) > 0.1
    with refused("target"):
        overlay_picture(tile, np.zeros((5, 2))).png()
    with refused("outline", "(5, 3)"):
        overlay_picture(tile, np.zeros((5, 3))).png()


def test_y_down_turns_the_picture_over(bent_tile: Any) -> None:
    tile = bent_tile("IH5")
    up = pixels(tiling_picture(tile).png(300)).astype(int)
    down = pixels(tiling_picture(tile, y_down=True).png(300)).astype(int)
    assert np.abs(up[::-1] - down).mean() < 4.0
    assert np.abs(up - down).mean() > 10.0


def test_absurd_sizes_are_refused(bent_tile: Any) -> None:
    with refused("1000000 by 666667 pixels"):
        tiling_picture(bent_tile("IH1")).png(10**6)


def test_field_picture(bent_tile: Any, equivariant: Any) -> None:
    tile = bent_tile("IH6")
    field = equivariant(tile.group)
    image = pixels(
        field_picture(lambda p: field(p.numpy()), tile.group, tile, sheet=Sheet.screen(300)).file()
    )
    assert image.shape[1] == 300
    assert image.std() > 20
    still = field_picture(lambda p: torch.zeros_like(p), tile.group, sheet=Sheet.screen(300)).file()
    assert pixels(still).shape[1] == 300


def test_field_picture_has_the_symmetry_of_the_group() -> None:
    """Half a turn about the middle, a 2-fold centre, leaves a p2 picture as it is."""
    group = isohedral_class("IH4").group()
    (center,) = (g(np.zeros(2)) / 2 for g in group.cosets[1:])
    window = (center[0] - 2, center[1] - 2, center[0] + 2, center[1] + 2)

    def odd(points: torch.Tensor) -> torch.Tensor:
        inverse = torch.as_tensor(group.inverse_lattice)
        u = 2 * np.pi * (points - torch.as_tensor(center)) @ inverse.T
        return torch.sin(u + u.flip(-1))

    image = pixels(field_picture(odd, group, window=window, sheet=Sheet.screen(400)).file()).astype(
        int
    )
    assert np.abs(image - image[::-1, ::-1]).mean() < 5.0  # the outlined cell has no such symmetry
    assert np.abs(image - image[::-1]).mean() > 15.0


def test_field_must_return_vectors() -> None:
    group = isohedral_class("IH4").group()
    with refused("field", "(267, 400)"):
        field_picture(lambda p: p[..., 0], group, sheet=Sheet.screen(100)).file()
    with refused("field", "(267, 400, 2)"):
        field_picture(lambda p: p * np.nan, group, sheet=Sheet.screen(100)).file()


def test_nine_classes() -> None:
    image = pixels(classes_png(width_px=600))
    assert image.shape == (492, 600, 3)
    for row in range(3):
        for column in range(3):
            panel = image[row * 157 : row * 157 + 157, column * 200 : column * 200 + 200]
            assert panel.std() > 20
