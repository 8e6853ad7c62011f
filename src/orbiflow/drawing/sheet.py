"""Sheets that figures are made for, a screen or a journal's column, and figures as files."""

# matplotlib types no keyword arguments
# pyright: reportUnknownMemberType=false

from __future__ import annotations

import io
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal, get_args

from orbiflow.errors import OrbiflowError
from orbiflow.settings import COLUMNS, as_choice, as_number, length

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FigureFormat = Literal["png", "pdf", "svg"]
FORMATS: tuple[FigureFormat, ...] = get_args(FigureFormat)

NARROWEST, WIDEST = 40.0, 1000.0
"""Widths in mm between which a printed figure has room for texts of its size."""

TEXT = 8.0
"""Size in points of a printed figure's texts; that of texts at ticks is `SMALL` of it, 7.2 points."""

SMALL = 0.9

_INCH = 25.4
_SCREEN_DPI = 200
_NOTEBOOK_DPI = 144
_FULL = 8.0
"""Width in inches of the figure that widths of lines are meant for."""

_LOCK = Lock()

MAX_PIXELS = 20_000
"""Largest width or height of a picture in pixels."""


def check_size(width_px: int, height_px: int) -> None:
    """Check that a picture can have this size."""
    if not (16 <= width_px <= MAX_PIXELS and 16 <= height_px <= MAX_PIXELS):
        raise OrbiflowError(
            f"a picture of {width_px} by {height_px} pixels cannot be made: sides go from 16 to "
            f"{MAX_PIXELS}; change the width or the window"
        )


@dataclass(frozen=True)
class Sheet:
    """The width of a figure, the size of its texts, and the format of its file.

    - `width`: Width in inches. `text`: Size of texts in points.
    - `format`: The format; "pdf" and "svg" hold curves and texts, "png" pixels.
    - `dpi`: Pixels per inch, also of those inside a PDF or SVG.
    - `printed`: Whether a caption will stand below it; then it has no title and no legend.

    >>> Sheet.column("single").text, Sheet.screen(1600).text
    (8.0, 9.5)
    """

    width: float
    text: float
    format: FigureFormat = "png"
    dpi: int = _SCREEN_DPI
    printed: bool = False

    @classmethod
    def screen(cls, width_px: int = 1600) -> Sheet:
        """Return a sheet of pixels to look at, whose texts grow with the picture."""
        return cls(width_px / _SCREEN_DPI, 9.5 * width_px / _SCREEN_DPI / 8)

    @classmethod
    def column(cls, width: str | float = "single", format: FigureFormat = "pdf") -> Sheet:
        """Return a sheet for print with texts of 7 to 8 points; a PNG has 600 dots per inch.

        The width is "single", "double" or from 40 to 1000 mm.
        """
        as_choice(format, FORMATS, "format")
        if isinstance(width, str):
            width = COLUMNS[as_choice(width, tuple(COLUMNS), "width")]
        width = as_number(width, "width", NARROWEST, WIDEST)  # narrower ones have no room for texts
        return cls(width / _INCH, TEXT, format, 600 if format == "png" else 300, True)

    @property
    def em(self) -> float:
        """Size of the texts in inches."""
        return self.text / 72

    @property
    def small(self) -> float:
        """Size of texts at ticks, in points."""
        return SMALL * self.text

    def pen(self, points: float, least: float = 0.25) -> float:
        """Return the width in points of a line that is `points` wide in a figure of eight inches."""
        return max(points * self.width / _FULL, least) if self.printed else points

    def figure(self, height: float, paper: str = "#ffffff") -> Figure:
        """Return an empty figure of the sheet's width, `height` inches high."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        if self.format == "png":
            check_size(round(self.width * self.dpi), round(height * self.dpi))
        figure = Figure(figsize=(self.width, height), dpi=self.dpi, facecolor=paper)
        FigureCanvasAgg(figure)
        return figure

    def file(self, figure: Figure, *, title: str = "", caption: str = "") -> bytes:
        """Return the figure's file, which keeps title and caption; the same figure, the same bytes."""
        buffer = io.BytesIO()
        options: dict[str, Any] = {"metadata": _metadata(self.format, title, caption)}
        if self.format == "png":
            options["pil_kwargs"] = {"compress_level": 3}
        options |= {"dpi": self.dpi, "facecolor": figure.get_facecolor()}
        with _plain_texts():
            figure.savefig(buffer, format=self.format, **options)
        return buffer.getvalue()


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure on its sheet.

    - `caption`: What its signs mean and what it leaves out, to be written below it in print.
    """

    figure: Figure
    sheet: Sheet
    title: str
    caption: str = ""

    def file(self) -> bytes:
        """Return the content of its file, in the sheet's format."""
        return self.sheet.file(self.figure, title=self.title, caption=self.caption)

    def _repr_png_(self) -> bytes:
        """Return what a notebook shows."""
        sheet = replace(self.sheet, format="png", dpi=min(self.sheet.dpi, _NOTEBOOK_DPI))
        return sheet.file(self.figure)


def pdf_pages(pictures: Sequence[Picture]) -> bytes:
    """Return one PDF with a page for each picture."""
    from matplotlib.backends.backend_pdf import PdfPages

    buffer = io.BytesIO()
    captions = [f"{picture.title}. {picture.caption}".strip() for picture in pictures]
    metadata = _metadata("pdf", pictures[0].title, " ".join(captions))
    with _plain_texts(), PdfPages(buffer, metadata=metadata) as pages:
        for picture in pictures:
            figure = picture.figure
            pages.savefig(figure, dpi=picture.sheet.dpi, facecolor=figure.get_facecolor())
    return buffer.getvalue()


def _metadata(form: FigureFormat, title: str, caption: str) -> dict[str, Any]:
    if form == "pdf":
        return {"Title": title, "Subject": caption, "Creator": "orbiflow", "CreationDate": None}
    if form == "svg":
        return {"Title": title, "Description": caption, "Creator": ["orbiflow"], "Date": None}
    return {"Software": "orbiflow"}


@contextmanager
def _plain_texts() -> Generator[None]:
    """Keep texts as texts, with whole fonts in a PDF and no outlines in an SVG, and names the same.

    Matplotlib has only global settings for this, so one figure is written at a time.
    """
    from matplotlib import rc_context  # pyright: ignore[reportUnknownVariableType]

    fonts: dict[Any, Any] = {"pdf.fonttype": 42, "svg.fonttype": "none", "svg.hashsalt": "orbiflow"}
    with _LOCK, rc_context(fonts):
        yield


def column_width(text: str) -> float:
    """Return the width in mm of a printed figure, from a word of `COLUMNS` or a length.

    >>> column_width("double"), column_width("8.5cm")
    (180.0, 85.0)
    """
    width = COLUMNS.get(text.strip().lower())
    return length(text) if width is None else width
