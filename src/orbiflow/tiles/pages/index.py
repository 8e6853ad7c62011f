"""`index.html`: all tiles of a search with their pictures, figures in words, and files to take.

One page without scripts; it refers to nothing but files beside it, so it works from a disk, out of an
archive and on a server, in light and dark, on a phone and on paper.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import PurePath

from orbiflow.drawing import (
    CLOSING,
    css,
    opening,
    window_of,
)
from orbiflow.tiles.pages.overview import measures
from orbiflow.tiles.pages.tile_folder import TILE_FILES
from orbiflow.tiles.search import ClassFailure
from orbiflow.tiles.silhouette import Target
from orbiflow.tiles.tile import EscherTile

CHOICES = {
    "tile.svg": "the tile (SVG)",
    "tiling.svg": "the tiling (SVG)",
    "tiling.png": "the tiling (PNG)",
    "overlay.png": "the comparison (PNG)",
    "tiling.pdf": "the tiling, for print (PDF)",
    "overlay.pdf": "the comparison, for print (PDF)",
    "field.png": "the flow (PNG)",
    "field.pdf": "the flow, for print (PDF)",
    "model.safetensors": "the map (safetensors)",
}
"""Files of a class, in words."""


def index_page(
    results: Sequence[EscherTile],
    target: Target,
    folders: Sequence[str],
    *,
    failures: Sequence[ClassFailure] = (),
    figures: Sequence[Sequence[str]] = (),
) -> str:
    """The page, to be written beside the folders.

    Args:
        results: of one search, best first.
        target: of the search.
        folders: name of each result's folder.
        failures: classes without a tile.
        figures: names of the files in each folder besides the `TILE_FILES`; default none.
    """
    name = PurePath(target.source).name
    extra = figures or [()] * len(results)
    compared = any(result.front is not None for result in results)
    head = _head(name, target, len(results), compared=compared)
    parts = [head, _contents(results, folders)]
    for k, (result, folder) in enumerate(zip(results, folders, strict=True)):
        parts.append(_article(result, folder, k + 1, name, tuple(extra[k])))
    if failures:
        rows = "".join(
            f"<li>{html.escape(failure.name)}: {html.escape(failure.reason)}</li>\n"
            for failure in failures
        )
        parts.append(f"<article>\n<h2>Without a tile</h2>\n<ul>\n{rows}</ul>\n</article>\n")
    parts.append(f"</main>\n{CLOSING}")
    return "".join(parts)


def _head(name: str, target: Target, count: int, *, compared: bool) -> str:
    title = f"Tiles that look like {name}"
    begin = opening(title, css("orbiflow.tiles.pages", "index_page.css"))
    tiles = "One tile" if count == 1 else f"{count} tiles, best first"
    notes = "".join(f"<li>{html.escape(note)}</li>\n" for note in target.notes)
    decided = f'<ul class="notes" aria-label="Decided for you">\n{notes}</ul>\n' if notes else ""
    front = ', by deformation and overlap: <a href="front.png">front.png</a>' if compared else ""
    return f"""{begin}<header>
{_silhouette(name, target)}
<div>
<h1>{html.escape(title)}</h1>
<p>{tiles}. Everything in numbers: <a href="result.json">result.json</a>; on one sheet:
<a href="overview.png">overview.png</a>{front}.</p>
{decided}</div>
</header>
<main>
"""


def _silhouette(name: str, target: Target) -> str:
    left, low, right, high = window_of([target.outline])
    scale = 100 / max(right - left, high - low)
    ring = (target.outline - (left, low if target.y_down else high)) * scale
    ring = ring * (1, 1 if target.y_down else -1)
    path = "L".join(f"{x:.1f},{y:.1f}" for x, y in ring)
    box = f"0 0 {(right - left) * scale:.1f} {(high - low) * scale:.1f}"
    label = html.escape(f"The silhouette, {name}")
    return (
        f'<svg viewBox="{box}" role="img" aria-label="{label}">'
        f'<path fill="currentColor" d="M{path}Z"/></svg>'
    )


def _contents(results: Sequence[EscherTile], folders: Sequence[str]) -> str:
    links = "".join(
        f'<li><a href="#{folder}">{k + 1}. {html.escape(folder)} ({html.escape(r.group_name)})</a>'
        "</li>\n"
        for k, (r, folder) in enumerate(zip(results, folders, strict=True))
    )
    return f'<nav aria-label="Tiles">\n<ol>\n{links}</ol>\n</nav>\n'


def _article(result: EscherTile, folder: str, rank: int, name: str, extra: tuple[str, ...]) -> str:
    rows = "".join(
        f"<div><dt>{html.escape(m.name)}</dt><dd><b>{html.escape(m.value)}</b> "
        f"{html.escape(m.words)}<small>{html.escape(m.meaning)}</small></dd></div>\n"
        for m in measures(result)
    )
    links = "".join(
        f'<li><a href="{folder}/{file}" download>{CHOICES.get(file, file)}</a></li>\n'
        for file in (*TILE_FILES, *extra)
    )
    return f"""<article id="{folder}">
<h2>{rank}. {html.escape(folder)} <span>{_group_and_aim(result)}</span></h2>
{_proof(result)}
<div class="pictures">
{_tiling(result, folder, name)}
<div class="side">
{_comparison(result, folder, name)}
{_tile(result, folder, name)}{"".join(_field(folder) for file in extra if file == "field.png")}
</div>
</div>
<dl>
{rows}</dl>
<ul class="downloads" aria-label="Files of {html.escape(folder)}">
{links}</ul>
</article>
"""


def _group_and_aim(result: EscherTile) -> str:
    group = f"wallpaper group {html.escape(result.group_name)}"
    if result.front is None:
        return group
    rest = "no other beats it in both" if result.front else "near the best"
    return f"{group}, found for {result.objective}: {rest}"


def _proof(result: EscherTile) -> str:
    certificate = result.certificate
    if not certificate.valid:
        reasons = html.escape("; ".join(certificate.reasons))
        return f'<p class="refused">Not certified: {reasons}.</p>'
    return (
        '<p class="certified">Certified: its copies cover the plane without gap or overlap; edges '
        f"match within {certificate.edge_mismatch:.0e} of the tile's size.</p>"
    )


def _figure(kind: str, href: str, alt: str, caption: str, size: str = "") -> str:
    return (
        f'<figure class="{kind}"><a href="{href}"><img src="{href}" alt="{html.escape(alt)}"{size} '
        f'loading="lazy"></a><figcaption>{caption}</figcaption></figure>'
    )


def _tiling(result: EscherTile, folder: str, name: str) -> str:
    alt = f"A tiling of class {result.name}: the plane covered by copies of a tile like {name}"
    size = ' width="1600" height="1067"'
    return _figure("tiling", f"{folder}/tiling.png", alt, "The tiling.", size)


def _comparison(result: EscherTile, folder: str, name: str) -> str:
    if result.bent is None:
        alt = f"The tile of {result.name} laid over {name}: what is missing and what is added"
        caption = "The tile over the silhouette: grey in both, orange missing, blue added."
    else:
        alt = (
            f"The silhouette {name}, and what it was bent to, the tile of {result.isohedral_class}"
        )
        caption = "The silhouette as it was, dashed, and bent: from blue, still, to red, moved far."
    return _figure("overlay", f"{folder}/overlay.png", alt, caption)


def _tile(result: EscherTile, folder: str, name: str) -> str:
    alt = f"The tile of {result.isohedral_class} like {name}, alone"
    return _figure("tile", f"{folder}/tile.svg", alt, "The tile alone.")


def _field(folder: str) -> str:
    alt = "The field whose flow made the tile, with the symmetries of its group"
    return "\n" + _figure("field", f"{folder}/field.png", alt, "The flow that made it.")
