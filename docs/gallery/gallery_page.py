"""The page of the gallery, and its contact sheet."""

from __future__ import annotations

import shlex
from pathlib import Path

from PIL import Image, ImageDraw

from gallery_table import HERE, Entry

PAGE = HERE / "README.md"
SHEET = HERE / "contact-sheet.webp"
COLUMNS, CELL, GAP = 5, (300, 225), 8
QUALITY = 72
ZOOM = 1.45
"""How much the contact sheet magnifies, so that the animals can be recognised."""

HEAD = """# Gallery

This page has {count} tilings of silhouettes, in all nine isohedral classes; the last ones have two
figures each ([two figures](../two-figures.md)). Each comes with the commands that make it.

![All of them](contact-sheet.webp)

Each tile is one closed shape, and it is certified that its copies cover the plane. The drawing lies
over the original silhouette, and came to the tile through the same map that bent the silhouette
([artwork](../artwork.md)). Body colours come from the palette, and neighbours never have the same
one. Lines are drawn in a colour that shows on the body.

Type the commands in the project's root; a search in one class takes some seconds.
`python docs/gallery/make.py` makes everything on this page again, and `--only owl` one picture. The
table behind the page is `gallery.toml`. Another machine may find tiles that differ a little.
"""

TAIL = """
## Draw your own

- Draw over the silhouette, in its frame (`viewBox`). What lies outside it is cut off. Draw a little
  beyond the outline to leave no gap.
- Leave the body open: its colour comes from the palette.
- Draw lines in `currentColor`, which is dark on light tiles and light on dark ones.
- Shade with black and white of little opacity.
- Keep colours of their own for what all animals have alike, such as beaks and eyes.
- Where two animals touch, let them differ. If both have a wide patch of the same colour there, their
  outlines are lost.

## Sources and licences

All drawings were made for this gallery and are under the project's licence (MIT). The silhouettes
come from these sources:

| tilings | silhouettes | licence |
|---|---|---|
"""


def compress(made: Path, entry: Entry) -> None:
    """Compress the picture that a command wrote into the one that the page shows."""
    image = Image.open(made).convert("RGB")
    entry.picture.parent.mkdir(exist_ok=True)
    image.save(entry.picture, quality=QUALITY, method=6)


def contact_sheet(entries: list[Entry]) -> None:
    """Write a sheet with the middle of every picture, side by side."""
    rows = -(-len(entries) // COLUMNS)
    step = (CELL[0] + GAP, CELL[1] + GAP)
    size = (COLUMNS * step[0] - GAP, rows * step[1] - GAP)
    sheet = Image.new("RGB", size, "#ffffff")
    for number, entry in enumerate(entries):
        row, column = divmod(number, COLUMNS)
        # a last row that is not full stands in the middle
        missing = COLUMNS - (len(entries) - row * COLUMNS) if row == rows - 1 else 0
        left = column * step[0] + missing * step[0] // 2
        sheet.paste(_middle(entry), (left, row * step[1]))
    sheet.save(SHEET, quality=QUALITY, method=6)


def _middle(entry: Entry) -> Image.Image:
    image = Image.open(entry.picture).convert("RGB")
    scale = ZOOM * max(CELL[0] / image.width, CELL[1] / image.height)
    size = (round(image.width * scale), round(image.height * scale))
    small = image.resize(size, Image.Resampling.LANCZOS)
    left, top = (small.width - CELL[0]) // 2, (small.height - CELL[1]) // 2
    cut = small.crop((left, top, left + CELL[0], top + CELL[1]))
    pen = ImageDraw.Draw(cut)
    wide = pen.textlength(entry.tile) + 8
    pen.rectangle((0, CELL[1] - 16, wide, CELL[1]), fill="#ffffff")
    pen.text((4, CELL[1] - 14), entry.tile, fill="#222222")
    return cut


def page(entries: list[Entry]) -> str:
    """Return the text of the page, README.md."""
    parts = [HEAD.format(count=len(entries))]
    for entry in entries:
        lines = "\n".join("    " + shown(words) for words in entry.commands())
        vector = f" As SVG: [{entry.name}.svg](pictures/{entry.name}.svg)." if entry.svg else ""
        parts.append(
            f"\n## {entry.title} ({entry.tile})\n\n![{entry.title}](pictures/{entry.name}.webp)\n\n"
            f"{entry.say}{vector}\n\n{lines}\n"
        )
    return "".join(parts) + TAIL + "".join(_credits(entries))


def shown(words: list[str]) -> str:
    """Return a command as one types it."""
    return shlex.join(["orbiflow", *words])


def _credits(entries: list[Entry]) -> list[str]:
    found = []
    for entry in entries:
        for _, _, image, source in entry.silhouettes:
            text = f" ([text]({source.text}))" if source.text else ""
            found.append(
                f"| {entry.title} | {image}: {source.by}, [{source.name}]({source.url}) | "
                f"{source.licence}{text} |\n"
            )
    return found
