"""The colour bar of a density's picture, beside its axes or below them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from orbiflow.figures.density_axes import INK, LETTER
from orbiflow.figures.density_frame import Framed, bar_label_lines
from orbiflow.figures.density_scale import Shade, bar_ticks, minor_places
from orbiflow.figures.sheet import Sheet

if TYPE_CHECKING:
    from matplotlib.image import AxesImage


_DIGIT = 0.66
"""Width of a digit, in ems: wider than the mean of letters."""


def colour_bar(
    image: AxesImage, frame: Framed, sheet: Sheet, label: str, extend: str = "neither"
) -> None:
    """The bar of an image's colours."""
    way = "horizontal" if frame.under else "vertical"
    bar = frame.figure.colorbar(image, cax=frame.bar, extend=extend, orientation=way)
    if sheet.printed or frame.under:
        label = "\n".join(bar_label_lines(sheet, label, frame.side))
    bar.set_label(label, fontsize=sheet.text, color=INK)
    bar.ax.tick_params(
        which="both", labelsize=sheet.small, width=sheet.pen(0.8), length=0.3 * sheet.text
    )
    bar.ax.tick_params(which="minor", length=0.18 * sheet.text)
    bar.ax.yaxis.get_offset_text().set_fontsize(sheet.small)
    bar.outline.set_visible(False)
    if frame.under:  # a few even steps
        from matplotlib.ticker import MaxNLocator

        bar.locator = MaxNLocator(max(2, int(frame.side / (8 * LETTER * sheet.em))))
        bar.update_ticks()


def shade_bar(image: AxesImage, frame: Framed, sheet: Sheet, shade: Shade, label: str) -> None:
    """The bar of a density's colours, with ticks in its own units."""
    extend = {(True, False): "max", (False, True): "min"}.get((shade.cut, shade.faint), "neither")
    colour_bar(image, frame, sheet, label, extend)
    ticks = bar_ticks(shade)
    at, texts = [tick.at for tick in ticks], [tick.text for tick in ticks]
    if frame.under:
        frame.bar.set_xticks(at, spread(at, texts, frame.side, sheet))
        frame.bar.set_xticks(minor_places(shade), minor=True)
    else:
        frame.bar.set_yticks(at, texts)
        frame.bar.set_yticks(minor_places(shade), minor=True)


def spread(at: Sequence[float], texts: Sequence[str], side: float, sheet: Sheet) -> list[str]:
    """Texts along a bar of so many inches, "" for those that would touch the one before.

    >>> spread([0.0, 0.1, 0.9], ["0.00", "0.10", "0.90"], 1.5, Sheet.column())
    ['0.00', '', '0.90']
    """
    letter, end, kept = _DIGIT * sheet.small / 72, -1.0, []
    for place, text in zip(at, texts, strict=True):
        half = letter * (len(text) + 1) / 2
        free = place * side - half > end
        kept.append(text if free else "")
        if free:
            end = place * side + half
    return kept
