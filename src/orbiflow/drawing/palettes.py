"""Palettes for tilings: colours that stay apart in print and for colour-blind eyes."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Annotated, NamedTuple

from orbiflow.errors import OrbiflowError
from orbiflow.settings import Parsed, is_a


class Palette(NamedTuple):
    """Fill colours in order of use, the outline between tiles, and the paper, as #rrggbb."""

    colours: tuple[str, ...]
    outline: str
    paper: str

    def fill(self, index: int) -> str:
        """Return colour number `index`; after the last they start again, mixed with the paper."""
        turn, place = divmod(index, len(self.colours))
        return _mixed(self.colours[place], self.paper, 0.5**turn)

    def mean(self, indices: Iterable[int]) -> str:
        """Return the mean of some of the colours.

        >>> Palette(("#000000", "#ff8000"), "#000000", "#ffffff").mean([0, 1])
        '#804000'
        """
        fills = [bytes.fromhex(self.fill(index)[1:]) for index in indices]
        return "#" + bytes(round(sum(band) / len(fills)) for band in zip(*fills, strict=True)).hex()

    def shaded(self, shares: Sequence[int]) -> Palette:
        """Return a palette of so many shades of each colour in turn, unless its colours are a user's.

        >>> PALETTES["ink"].shaded((2, 1)).colours
        ('#f5f5f2', '#d1d1ce', '#2b2b2b')
        """
        if self not in PALETTES.values():
            return self
        colours = (
            self._shade(self.fill(k), turn / max(1, count - 1))
            for k, count in enumerate(shares)
            for turn in range(count)
        )
        return self._replace(colours=tuple(colours))

    def _shade(self, fill: str, turn: float) -> str:
        """Return a shade of a colour, from itself at 0 to its last one at 1."""
        if lightness(fill) > 0.5:
            return _mixed(fill, self.outline, 1 - DARKEST * turn)
        return _mixed(fill, self.paper, 1 - LIGHTEST * turn)

    def shortage(self, count: int) -> tuple[str, ...]:
        """Return notes for a user who needs more colours than there are.

        >>> palette("e76f51").shortage(3)
        ('3 colours are needed and the palette has 1: the others are paler shades of it',)
        """
        size, first = len(self.colours), "it" if len(self.colours) == 1 else "the first"
        needed = f"{count} colours are needed and the palette has {size}"
        return (f"{needed}: the others are paler shades of {first}",) * (size < count)

    def ink(self, index: int) -> str:
        """Return the colour of lines on colour number `index`: outline or paper, whichever shows.

        >>> PALETTES["delft"].ink(0), PALETTES["delft"].ink(1)
        ('#14263a', '#ffffff')
        """
        fill = lightness(self.fill(index))
        dark, light = lightness(self.outline), lightness(self.paper)
        return self.outline if abs(fill - dark) >= abs(light - fill) else self.paper


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
    "earth": Palette(("#ecdcb9", "#6b3018", "#c9a23f", "#55707a"), "#24180f", "#f8f1e0"),
    "sea": Palette(("#d9efe9", "#0f4c5c", "#4fa8a0", "#f2c879"), "#082a33", "#fbfdfc"),
    "dusk": Palette(("#f7dcc6", "#33265c", "#c4506e", "#9fa4d8"), "#1d1433", "#fff6ef"),
    "forest": Palette(("#ebe6c4", "#1c4733", "#9dbb5c", "#b05a20"), "#10281c", "#fbfaf0"),
    "pastel": Palette(("#ffffff", "#5f8fc8", "#dba9cd", "#f4dc8c"), "#4a4f6a", "#f4f0f8"),
    "festival": Palette(("#f7c548", "#b3202c", "#157f86", "#f4efe2"), "#2a1216", "#fffaf0"),
    "woodcut": Palette(("#f3e9d6", "#1f1b18", "#b5452c", "#a79a84"), "#120e0c", "#fcf7ea"),
    "moss": Palette(("#eef0d5", "#36442a", "#a9b565", "#b5726d"), "#20270f", "#fcfdf3"),
    "clay": Palette(("#f4e0d0", "#54261f", "#d58559", "#8aa9b8"), "#2c1410", "#fff8f2"),
    "print": Palette(("#f7f5ef", "#26241f", "#9a968b", "#5f5b52"), "#151310", "#fbfaf6"),
}
"""The palettes by name. The first four colours of each differ by at least 0.1 in OKLab under every
dichromacy (tested).

"okabe-ito" is after M. Okabe and K. Ito, "Color universal design", 2008.
"""

DEFAULT_PALETTE = "delft"
# The share of the outline's or the paper's colour in the last shade of one that is light or dark
DARKEST, LIGHTEST = 0.16, 0.42
MAX_COLOURS = 24
"""Colours of a palette that the user writes out, at most."""


_HEX = re.compile(r"#?([0-9a-fA-F]{6})")


def palette(name: str | Palette) -> Palette:
    """Return the palette of a name, or one that is written out; a `Palette` is returned as it is.

    Args:
        name: One of `PALETTES`; or colours rrggbb with commas between them, and perhaps
            `outline=rrggbb` (default: a dark shade of the darkest) and `paper=rrggbb` (default: white).

    Raises:
        OrbiflowError: If the name is unknown, or a colour is none.

    >>> palette("ink").fill(1)
    '#2b2b2b'
    >>> palette("e76f51,2a9d8f,paper=fffdf8")
    Palette(colours=('#e76f51', '#2a9d8f'), outline='#113f39', paper='#fffdf8')
    """
    if isinstance(name, Palette):
        return name
    if not is_a(name, str):
        raise OrbiflowError(f"a palette must be a str, got {name!r}; a name or colours")
    if name in PALETTES:
        return PALETTES[name]
    if "," in name or "=" in name or _HEX.fullmatch(name):
        return _written_out(name)
    raise OrbiflowError(
        f"unknown palette {name[:60]!r}; there are {', '.join(PALETTES)}, and your own: colours such "
        "as e76f51,2a9d8f,outline=1b2f38,paper=fffdf8"
    )


def palette_name(text: str) -> str:
    """Return the text if `palette` can read it."""
    palette(text)
    return text


PaletteName = Annotated[
    str,
    Parsed(
        palette_name,
        "a palette's name, or colours such as e76f51,2a9d8f,outline=1b2f38",
        "PALETTE",
        values=f"{', '.join(PALETTES)}, or colours such as e76f51,2a9d8f,outline=1b2f38",
    ),
]
"""A palette, for settings classes: its name, or its colours."""


def _written_out(text: str) -> Palette:
    colours: list[str] = []
    named: dict[str, str] = {}
    for part in text.split(","):
        name, _, value = part.strip().rpartition("=")
        match = _HEX.fullmatch(value.strip())
        if match is None or name not in ("", "outline", "paper") or name in named:
            raise OrbiflowError(
                f"palette: {part.strip()[:40]!r} is no colour; write rrggbb, outline=rrggbb or "
                "paper=rrggbb (each of these once), such as e76f51,2a9d8f,outline=1b2f38"
            )
        colour = "#" + match[1].lower()
        if name:
            named[name] = colour
        else:
            colours.append(colour)
    if not 1 <= len(colours) <= MAX_COLOURS:
        raise OrbiflowError(f"a palette has 1 to {MAX_COLOURS} colours, got {len(colours)}")
    dark = _mixed(min(colours, key=lightness), "#000000", 0.4)
    return Palette(tuple(colours), named.get("outline", dark), named.get("paper", "#ffffff"))


def _mixed(colour: str, paper: str, share: float) -> str:
    pairs = [(int(colour[i : i + 2], 16), int(paper[i : i + 2], 16)) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(share * a + (1 - share) * b):02x}" for a, b in pairs)


def lightness(colour: str) -> float:
    """Return about how light a colour looks, 0 to 1."""
    weights = (0.2126, 0.7152, 0.0722)
    parts = (int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return sum(w * part**2.2 for w, part in zip(weights, parts, strict=True)) ** (1 / 2.2)
