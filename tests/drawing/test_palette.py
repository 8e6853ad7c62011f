"""Palettes keep their colours apart, for colour-blind eyes too."""

from itertools import combinations

import numpy as np
import pytest

from orbiflow.arrays import Array
from orbiflow.drawing import PALETTES, palette
from refusals import refused


def matrix(rows: str) -> Array:
    return np.array(rows.split(), dtype=np.float64).reshape(3, 3)


# Machado, Oliveira and Fernandes, "A physiologically-based model for simulation of color vision
# deficiency", IEEE TVCG 15, 2009: severity 1, linear RGB.
DICHROMACIES = {
    "none": np.eye(3),
    "protan": matrix(
        "0.152286 1.052583 -0.204868 0.114503 0.786281 0.099216 -0.003882 -0.048116 1.051998"
    ),
    "deutan": matrix(
        "0.367322 0.860646 -0.227968 0.280085 0.672501 0.047413 -0.011820 0.042940 0.968881"
    ),
    "tritan": matrix(
        "1.255528 -0.076749 -0.178779 -0.078411 0.930809 0.147602 0.004733 0.691367 0.303900"
    ),
}
TO_LMS = matrix("""
0.4122214708 0.5363325363 0.0514459929
0.2119034982 0.6806995451 0.1073969566
0.0883024619 0.2817188376 0.6299787005
""")
TO_OKLAB = matrix("""
0.2104542553 0.7936177850 -0.0040720468
1.9779984951 -2.4285922050 0.4505937099
0.0259040371 0.7827717662 -0.8086757660
""")


def oklab(colour: str, seen: Array) -> Array:
    """OKLab (B. Ottosson, 2020) of #rrggbb as a dichromat sees it."""
    srgb = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return TO_OKLAB @ np.cbrt(TO_LMS @ np.clip(seen @ linear, 0, 1))


@pytest.mark.parametrize("name", PALETTES)
@pytest.mark.parametrize("sight", DICHROMACIES)
def test_first_four_colours_differ(name: str, sight: str) -> None:
    seen = DICHROMACIES[sight]
    for first, second in combinations(PALETTES[name].colours[:4], 2):
        assert np.linalg.norm(oklab(first, seen) - oklab(second, seen)) >= 0.1, (first, second)


def test_as_many_colours_as_needed() -> None:
    for chosen in PALETTES.values():
        fills = [chosen.fill(k) for k in range(2 * len(chosen.colours))]
        assert len(set(fills)) == len(fills)
        assert all(len(fill) == 7 for fill in fills)


def test_names() -> None:
    own = palette("ink")._replace(paper="#eeeeee")
    assert palette(own) is own
    with refused("okabe-ito"):
        palette("puce")


def test_spelt_out() -> None:
    own = palette("#E76F51, 2a9d8f,paper=fffdf8")
    assert own.colours == ("#e76f51", "#2a9d8f")
    assert own.paper == "#fffdf8"
    assert palette("e76f51,outline=010203").outline == "#010203"
    assert palette("e76f51").paper == "#ffffff"


@pytest.mark.parametrize(
    "text",
    [
        *("e76f5", "e76f51,", "e76f51,frame=000000", "paper=ffffff", "outline=0,e76f51"),
        ",".join(["000000"] * 25),
    ],
)
def test_misspelt(text: str) -> None:
    with refused("palette"):
        palette(text)


def test_one_of_each() -> None:
    with refused("palette", "paper"):
        palette("e76f51,paper=ffffff,paper=000000")
