"""What a figure is made for: a screen, or a column of a journal; and the figure as a file."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from threading import Lock
from typing import TYPE_CHECKING, Any, Literal, get_args

from orbiflow.errors import OrbiflowError
from orbiflow.units import COLUMNS, length

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FigureFormat = Literal["png", "pdf", "svg"]
FORMATS: tuple[FigureFormat, ...] = get_args(FigureFormat)

NARROWEST, WIDEST = 40.0, 1000.0
"""Of a figure in print, in mm: texts of a given size need room."""

TEXT = 8.0
"""Points of a printed figure's texts; those at ticks are `SMALL` of it, 7.2 points."""

SMALL = 0.9

_INCH = 25.4
_SCREEN_DPI = 200
_NOTEBOOK_DPI = 144
_FULL = 8.0
"""Inches of the figure that widths of lines are meant for."""

_LOCK = Lock()


@dataclass(frozen=True)
class Sheet:
    """How wide a figure is, how large its texts are, and which kind of file it becomes.

    - `width`: in inches.
    - `text`: in points.
    - `format`: "pdf" and "svg" hold curves and texts, "png" pixels.
    - `dpi`: of pixels, those inside a PDF or SVG among them.
    - `printed`: whether a caption will stand below it: then there is no title, nor a legend of signs.

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
        """Pixels to look at; texts grow with the picture."""
        return cls(width_px / _SCREEN_DPI, 9.5 * width_px / _SCREEN_DPI / 8)

    @classmethod
    def column(cls, width: str | float = "single", format: FigureFormat = "pdf") -> Sheet:
        """A figure for print, with texts of 7 to 8 points.

        Args:
            width: "single" or "double", or mm.
            format: of the file; a PNG has 600 dots per inch.

        Raises:
            OrbiflowError: for another word, a width below 40 or above 1000 mm, or another format.
        """
        if format not in FORMATS:
            raise OrbiflowError(f"format must be one of {', '.join(FORMATS)}, got {format!r}")
        if isinstance(width, str):
            if width not in COLUMNS:
                raise OrbiflowError(
                    f"width must be {', '.join(COLUMNS)} or a number of mm, got {width!r}"
                )
            width = COLUMNS[width]
        if isinstance(width, bool) or not NARROWEST <= width <= WIDEST:
            raise OrbiflowError(
                f"a figure is {NARROWEST:g} to {WIDEST:g} mm wide, got {width!r}: narrower ones "
                "have no room for texts that can be read"
            )
        return cls(float(width) / _INCH, TEXT, format, 600 if format == "png" else 300, True)

    @property
    def em(self) -> float:
        """The texts' size in inches."""
        return self.text / 72

    @property
    def small(self) -> float:
        """Size of the texts at ticks, in points."""
        return SMALL * self.text

    def pen(self, points: float, least: float = 0.25) -> float:
        """The width of a line, in points, that is as wide as given in a figure of eight inches."""
        return max(points * self.width / _FULL, least) if self.printed else points

    def figure(self, height: float, paper: str = "#ffffff") -> Figure:
        """An empty figure of the sheet's width, `height` inches high.

        Raises:
            OrbiflowError: if it would have too few or too many pixels.
        """
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        from orbiflow.drawing.canvas import check_size

        if self.format == "png":
            check_size(round(self.width * self.dpi), round(height * self.dpi))
        figure = Figure(figsize=(self.width, height), dpi=self.dpi, facecolor=paper)
        FigureCanvasAgg(figure)
        return figure

    def file(self, figure: Figure, *, title: str = "", caption: str = "") -> bytes:
        """The figure's file; the same figure gives the same bytes.

        Args:
            title, caption: to be kept in the file.
        """
        buffer = io.BytesIO()
        options: dict[str, Any] = {"metadata": _metadata(self.format, title, caption)}
        if self.format == "png":
            options["pil_kwargs"] = {"compress_level": 3}
        with _plain_texts():
            figure.savefig(
                buffer,
                format=self.format,
                dpi=self.dpi,
                facecolor=figure.get_facecolor(),
                **options,
            )
        return buffer.getvalue()


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure on its sheet.

    - `caption`: what its signs mean and what it leaves out, for the words below it in print.
    """

    figure: Figure
    sheet: Sheet
    title: str
    caption: str = ""

    def file(self) -> bytes:
        """The content of its file, of the sheet's format."""
        return self.sheet.file(self.figure, title=self.title, caption=self.caption)

    def _repr_png_(self) -> bytes:
        """What a notebook shows."""
        sheet = replace(self.sheet, format="png", dpi=min(self.sheet.dpi, _NOTEBOOK_DPI))
        return sheet.file(self.figure)


def pdf_pages(pictures: Sequence[Picture]) -> bytes:
    """One PDF with a page a picture."""
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
def _plain_texts() -> Iterator[None]:
    """Texts stay texts: whole fonts in a PDF, no outlines of letters in an SVG; names without chance.

    Matplotlib has these as global settings alone, so one figure is written at a time.
    """
    from matplotlib import rc_context

    settings: dict[Any, Any] = {
        "pdf.fonttype": 42,
        "svg.fonttype": "none",
        "svg.hashsalt": "orbiflow",
    }
    with _LOCK, rc_context(settings):
        yield


def column_width(text: str) -> float:
    """Return the width in mm of a printed figure, from a word of `orbiflow.units.COLUMNS` or a length.

    Raises:
        OrbiflowError: As `orbiflow.units.length`, and for a width that no figure has.

    >>> column_width("double"), column_width("8.5cm")
    (180.0, 85.0)
    """
    word = text.strip().lower()
    width = COLUMNS[word] if word in COLUMNS else length(text)
    Sheet.column(width)
    return width
