"""Palettes for tilings: colours that stay apart in print and for colour-blind eyes."""

from __future__ import annotations

from typing import NamedTuple

from orbiflow.errors import OrbiflowError


class Palette(NamedTuple):
    """Fill colours in order of use, the outline between tiles and the paper, as #rrggbb."""

    colours: tuple[str, ...]
    outline: str
    paper: str

    def fill(self, index: int) -> str:
        """Colour number `index`; past the end they start again, mixed half with the paper."""
        turn, place = divmod(index, len(self.colours))
        return _mixed(self.colours[place], self.paper, 0.5**turn)


PALETTES: dict[str, Palette] = {
    "delft": Palette(("#f4ecdc", "#1d4e79", "#8ab6d9", "#d98a2b"), "#14263a", "#ffffff"),
    "lagoon": Palette(
        ("#e9c46a", "#264653", "#2a9d8f", "#f6efe0", "#e76f51"), "#1b2f38", "#fffdf8"
    ),
    "ochre": Palette(("#f3e3c3", "#8c3b1f", "#dd9f3d", "#3a2a23"), "#2a1a12", "#fffaf0"),
    "heather": Palette(("#efe6f2", "#4a2c6b", "#b48ac4", "#e0a458"), "#2a1a3d", "#ffffff"),
    "ink": Palette(("#f5f5f2", "#2b2b2b", "#a3a3a0", "#6a6a68"), "#111111", "#ffffff"),
    "okabe-ito": Palette(
        ("#f0e442", "#0072b2", "#e69f00", "#56b4e9", "#d55e00", "#cc79a7"), "#1a1a1a", "#ffffff"
    ),
}
"""By name. The first four of each differ by at least 0.1 in OKLab under every dichromacy (tested).

"okabe-ito" is after M. Okabe and K. Ito, "Color universal design", 2008.
"""

DEFAULT_PALETTE = "delft"


def palette(name: str | Palette) -> Palette:
    """The palette called `name`; a `Palette` is returned as it is.

    Raises:
        OrbiflowError: for an unknown name.

    >>> palette("ink").fill(1)
    '#2b2b2b'
    """
    if isinstance(name, Palette):
        return name
    if name not in PALETTES:
        raise OrbiflowError(f"unknown palette {name!r}; there are {', '.join(PALETTES)}")
    return PALETTES[name]


def _mixed(colour: str, paper: str, share: float) -> str:
    pairs = [(int(colour[i : i + 2], 16), int(paper[i : i + 2], 16)) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(share * a + (1 - share) * b):02x}" for a, b in pairs)
