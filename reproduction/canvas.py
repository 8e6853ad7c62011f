"""Where an exhibit's pictures go: each as PNG for the page and as PDF for a paper."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from PIL import Image

from orbiflow.drawing import (
    DPI,
    blank_figure,
    png_bytes,
)
from orbiflow.runtime import write_atomic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WIDTH = 1800
"""Pixels of a picture's width unless it asks for another."""


class Picture(NamedTuple):
    """A picture of the page.

    - `file`: its PNG; `others`: files beside it that show the same, by what they are.
    - `alt`: what one would see. `caption`: what it means.
    - `width`, `height`: of the PNG, in pixels.
    """

    file: str
    alt: str
    caption: str
    width: int
    height: int
    others: tuple[tuple[str, str], ...] = ()


class Canvas:
    """Makes figures of an exhibit and writes them into a folder.

    - `pictures`: those that were added.

    Args:
        folder: that is there.
        name: of the exhibit, which all files begin with.
    """

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, name
        self.pictures: list[Picture] = []

    def figure(self, height: float, width: int = WIDTH) -> Figure:
        """An empty figure `width` pixels wide and `height` times as high."""
        return blank_figure(width, round(height * width))

    def add(
        self,
        figure: Figure,
        alt: str,
        caption: str = "",
        *,
        part: str = "",
        pages: dict[str, str] | None = None,
        exact: bool = False,
    ) -> None:
        """Write a figure as PNG and PDF.

        Args:
            figure: of `self.figure`.
            alt: what one sees, for who cannot.
            caption: below it.
            part: what sets it apart, where the exhibit has several.
            pages: texts of further files by their names, which belong to it.
            exact: whether the PNG keeps all its colours; else it has 256, and a third of the bytes.

        Raises:
            OutputError: if a file cannot be written.
        """
        stem = f"{self.name}-{part}" if part else self.name
        picture = png_bytes(figure)
        write_atomic(self.folder / f"{stem}.png", picture if exact else _fewer_colours(picture))
        write_atomic(self.folder / f"{stem}.pdf", pdf_bytes(figure))
        others = [("PDF", f"{stem}.pdf")]
        for file, text in (pages or {}).items():
            write_atomic(self.folder / f"{self.name}-{file}.html", text)
            others.append((file.replace("-", " "), f"{self.name}-{file}.html"))
        size = (figure.get_size_inches() * DPI).round().astype(int)
        self.pictures.append(
            Picture(f"{stem}.png", alt, caption, int(size[0]), int(size[1]), tuple(others))
        )


def _fewer_colours(png: bytes) -> bytes:
    image = Image.open(io.BytesIO(png)).convert("RGB")
    buffer = io.BytesIO()
    # no dither: it would triple the bytes
    image.quantize(256, dither=Image.Dither.NONE).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def pdf_bytes(figure: Figure) -> bytes:
    """The figure as PDF, lines and texts as such, in fonts that journals take; always the same."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"pdf.fonttype": 42}):
        figure.savefig(
            buffer,
            format="pdf",
            dpi=DPI,
            facecolor=figure.get_facecolor(),
            metadata={"CreationDate": None, "Creator": "orbiflow"},
        )
    return buffer.getvalue()
