"""What two files have in common: numbers, geometry read back, pixels."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, cast
from xml.etree import ElementTree

import numpy as np
from PIL import Image, ImageSequence
from same_cases import Renamed

IGNORED = {
    *("seconds", "wall_seconds", "core_seconds", "timings"),
    *("versions", "version", "schema_version"),
    *("source", "sources", "file", "notes", "note", "reasons", "reason"),
}
"""Keys and columns of times, versions, paths and words."""
FLOOR = 1e-3
"""Numbers smaller than this, and than all of their array, count as differing relative to this."""


class Tolerances(NamedTuple):
    """What still counts as the same.

    - `number`: Greatest difference of two numbers relative to the greater; in an array, to its
      greatest.
    - `level`: Levels of 255 by which a pixel may differ.
    - `share`: Share of pixels that may differ by more.
    """

    number: float = 1e-8
    level: int = 2
    share: float = 1e-4


@dataclass
class Finding:
    """What comparing two files has found so far.

    - `size`: Greatest relative difference of two numbers that are the same within the tolerance.
    - `pixels`: Greatest share of a picture's pixels that differ.
    - `wrong`: What differs, where.
    """

    renamed: Renamed
    tolerances: Tolerances
    size: float = 0.0
    pixels: float = 0.0
    wrong: list[str] = field(default_factory=list[str])
    exact: bool = True

    def verdict(self) -> str:
        if self.wrong:
            more = f" (and {len(self.wrong) - 3} more)" if len(self.wrong) > 3 else ""
            return "DIFFERS: " + "; ".join(self.wrong[:3]) + more
        if self.pixels:
            return f"same but for {self.pixels:.1e} of pixels"
        if self.size:
            return f"same to {self.size:.1e}"
        return "same bit for bit" if self.exact else "same"

    def absorb(self, other: Finding) -> None:
        self.size, self.pixels = max(self.size, other.size), max(self.pixels, other.pixels)
        self.exact = self.exact and other.exact
        self.wrong += other.wrong

    def numbers(self, one: Any, two: Any, where: str) -> None:
        """Compare two arrays of numbers; not-a-number equals itself."""
        a, b = np.asarray(one), np.asarray(two)
        if a.shape != b.shape:
            self.wrong.append(f"{where} has shape {b.shape}, was {a.shape}")
            return
        if not a.size or np.array_equal(a, b):
            return
        a, b = np.asarray(a, float), np.asarray(b, float)
        finite = np.isfinite(a) & np.isfinite(b)
        if not np.array_equal(a[~finite], b[~finite], equal_nan=True):
            self.wrong.append(f"{where} is finite in one alone")
            return
        if not finite.any():
            return
        scale = max(np.abs(a[finite]).max(), np.abs(b[finite]).max(), FLOOR)
        size = float(np.abs(a - b)[finite].max() / scale)
        if size > self.tolerances.number:
            was = f": {b.item()!r}, was {a.item()!r}" if a.size == 1 else ""
            self.wrong.append(f"{where} by {size:.1e}{was}")
        self.size = max(self.size, size)

    def same(self, one: Any, two: Any, where: str) -> None:
        """Compare two values that must be equal."""
        if one != two:
            self.wrong.append(f"{where} is {short(two)}, was {short(one)}")

    def pictures(self, one: Image.Image, two: Image.Image, where: str) -> None:
        """Compare two pictures pixel by pixel."""
        if one.size != two.size:
            self.wrong.append(f"{where} is {two.size} pixels, was {one.size}")
            return
        a, b = (np.asarray(picture.convert("RGBA"), int) for picture in (one, two))
        off = np.abs(a - b).max(axis=-1)
        share = float((off > self.tolerances.level).mean())
        if share > self.tolerances.share:
            self.wrong.append(f"{where}: {share:.1e} of pixels by up to {off.max()} of 255")
        self.pixels = max(self.pixels, float((off > 0).mean()))


def short(value: Any) -> str:
    text = repr(value)
    return text if len(text) < 60 else text[:57] + "..."


def compare_files(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare two files by what is in them."""
    if one.read_bytes() == two.read_bytes():
        return
    compare = FORMATS.get(one.suffix)
    if compare is None:
        found.wrong.append(f"{where}: other bytes")
        return
    try:
        compare(one, two, where, found)
    except Exception as error:
        found.wrong.append(f"{where} cannot be compared: {error!r}")


def compare_json(one: Path, two: Path, where: str, found: Finding) -> None:
    a, b = (json.loads(path.read_text()) for path in (one, two))
    compare_values(a, b, where, found)


def compare_records(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare what a batch wrote of each item, in any order, but not how it knows an item again."""
    read = [[json.loads(line) for line in path.read_text().splitlines()] for path in (one, two)]
    for records in read:
        records.sort(key=lambda record: str(record.get("name")))
        for record in records:
            record.pop("settings", None)
            record.pop("code", None)
    compare_values(read[0], read[1], where, found)


def compare_values(a: Any, b: Any, where: str, found: Finding) -> None:
    """Compare two values as JSON has them, numbers by the tolerance."""
    if isinstance(a, dict) and isinstance(b, dict):
        compare_dicts(a, b, where, found)
    elif is_number(a) and is_number(b):
        found.numbers(a, b, where)
    elif isinstance(a, list) and isinstance(b, list):
        one, two = as_array(a), as_array(b)
        if one is not None and two is not None:
            found.numbers(one, two, where)
        elif len(a) != len(b):
            found.wrong.append(f"{where} has {len(b)} items, had {len(a)}")
        else:
            for number, pair in enumerate(zip(a, b, strict=True)):
                compare_values(*pair, f"{where}[{number}]", found)
    elif isinstance(a, str) and isinstance(b, str):
        found.same(found.renamed.values.get(a, a), b, where)
    else:
        found.same(a, b, where)


def compare_dicts(a: dict[str, Any], b: dict[str, Any], where: str, found: Finding) -> None:
    keys, inside = found.renamed.keys, where.rpartition(":")[2]
    names = {key: keys.get(f"{inside}.{key}", keys.get(key, key)) for key in a}
    was = {name: value for key, value in a.items() if (name := names[key])}
    now = {key: value for key, value in b.items() if key not in found.renamed.added or key in was}
    for key in [*was, *(key for key in now if key not in was)]:
        if key in IGNORED:
            continue
        if key not in now:
            found.wrong.append(f"{where}: no {key}")
        elif key not in was:
            found.wrong.append(f"{where}: {key} is new")
        else:
            compare_values(was[key], now[key], f"{where}:{key}", found)


def is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def as_array(values: list[Any]) -> np.ndarray | None:
    """Return nested lists of numbers as an array, or None if they are anything else."""
    try:
        array = np.asarray(values)
    except ValueError:
        return None
    return array if array.dtype.kind in "if" else None


def compare_csv(one: Path, two: Path, where: str, found: Finding) -> None:
    a, b = (list(csv.reader(io.StringIO(path.read_text()))) for path in (one, two))
    if len(a) != len(b):
        found.wrong.append(f"{where} has {len(b)} lines, had {len(a)}")
        return
    columns = [dict(zip(table[0], zip(*table[1:], strict=True), strict=True)) for table in (a, b)]
    was, now = (
        {key: [parsed(cell) for cell in cells] for key, cells in c.items()} for c in columns
    )
    compare_dicts(was, now, where, found)


def parsed(cell: str) -> Any:
    try:
        return float(cell)
    except ValueError:
        return cell


def compare_safetensors(one: Path, two: Path, where: str, found: Finding) -> None:
    from safetensors import safe_open

    loaded = []
    for path in (one, two):
        with safe_open(path, "numpy") as file:
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
            header = {key: as_json(text) for key, text in (file.metadata() or {}).items()}
            loaded.append((arrays, header))
    (was, head), (now, header) = loaded
    compare_values(head, header, f"{where}:header", found)
    keys = found.renamed.keys
    names = {new: array for name, array in was.items() if (new := keys.get(name, name))}
    if names.keys() != now.keys():
        found.same(sorted(names), sorted(now), f"{where}: arrays")
    for name in names.keys() & now.keys():
        found.numbers(names[name], now[name], f"{where}:{name}")


def as_json(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError:
        return text


NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


def compare_svg(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare the trees of elements; where these differ, the shapes that they draw."""
    elements = Finding(found.renamed, found.tolerances)
    a, b = (list(svg_elements(path)) for path in (one, two))
    words = [[text for text, _ in elements] for elements in (a, b)]
    if words[0] == words[1]:
        for (text, was), (_, now) in zip(a, b, strict=True):
            elements.numbers(was, now, f"{where} {text[:30]}")
        found.absorb(elements)
        return
    if any("animate" in text for text in words[0]):
        found.wrong.append(f"{where}: other elements: {first_other(*words)}")
        return
    found.exact = False
    compare_shapes(svg_shapes(one), svg_shapes(two), where, found)


def svg_elements(path: Path) -> Iterator[tuple[str, list[float]]]:
    """Yield each element but texts: its name and attributes without numbers, and its numbers."""
    for element in ElementTree.parse(path).iter():
        tag = str(element.tag).rpartition("}")[2]
        if tag in {"metadata", "title", "desc", "text", "tspan"} or "RDF" in str(element.tag):
            continue
        attributes = " ".join(
            f"{key}={value}" for key, value in sorted(element.items()) if "aria" not in key
        )
        style = (element.text or "") if tag == "style" else ""
        whole = f"{tag} {attributes} {style}"
        yield NUMBER.sub("#", whole), [float(number) for number in NUMBER.findall(whole)]


def first_other(one: list[str], two: list[str]) -> str:
    pairs = zip(one, two, strict=False)
    return next(
        (f"{short(b)}, was {short(a)}" for a, b in pairs if a != b), f"{len(two)}, were {len(one)}"
    )


Shape = tuple[str, np.ndarray]


def svg_shapes(path: Path) -> list[Shape]:
    """Return the shapes that svgelements reads: colours and kinds of segments, and points in order."""
    from svgelements import SVG
    from svgelements import Path as Outline
    from svgelements import Shape as Drawn

    shapes: list[Shape] = []
    for element in cast(Any, SVG.parse(str(path), reify=True)).elements():
        if isinstance(element, Drawn):
            outline: Any = abs(cast(Any, Outline(element)))
            outline.approximate_arcs_with_cubics()
            points = [(p.x, p.y) for segment in outline for p in segment if p is not None]
            kinds = "".join(type(segment).__name__[0] for segment in outline)
            style = cast(Any, element)
            shapes.append((f"{style.fill} {style.stroke} {kinds}", np.array(points)))
    return shapes


def compare_shapes(one: list[Shape], two: list[Shape], where: str, found: Finding) -> None:
    """Compare shapes in the order in which they are drawn."""
    words = [[text for text, _ in shapes] for shapes in (one, two)]
    if words[0] != words[1]:
        found.wrong.append(f"{where}: other shapes: {first_other(*words)}")
        return
    for number, ((_, was), (_, now)) in enumerate(zip(one, two, strict=True)):
        found.numbers(was, now, f"{where} shape {number}")


def compare_dxf(one: Path, two: Path, where: str, found: Finding) -> None:
    compare_shapes(dxf_shapes(one), dxf_shapes(two), where, found)


def dxf_shapes(path: Path) -> list[Shape]:
    """Return the entities that ezdxf reads: layer, colour, kind, and points in order."""
    from ezdxf.filemanagement import readfile

    document = readfile(path)
    shapes: list[Shape] = [(f"units {document.units}", np.zeros(0))]
    for layer in document.layers:
        shapes.append((f"layer {layer.dxf.name} {layer.dxf.color}", np.zeros(0)))
    for entity in cast(list[Any], list(document.modelspace())):
        values: list[float] = []
        for name, value in sorted(entity.dxfattribs().items()):
            if name not in {"handle", "owner"} and not isinstance(value, str):
                values += np.ravel(np.array(value)).tolist()  # a number, or a Vec3
        for name in ("vertices_in_wcs", "control_points", "fit_points", "knots"):
            points = getattr(entity, name, None)
            points = cast(Any, points() if callable(points) else points)
            values += [float(x) for point in points or () for x in np.ravel(np.array(point))]
        if entity.dxftype() == "LWPOLYLINE":
            values += np.ravel(np.array(entity.get_points())).tolist()
        shapes.append((f"{entity.dxftype()} {entity.dxf.layer}", np.array(values, float)))
    return shapes


def compare_png(one: Path, two: Path, where: str, found: Finding) -> None:
    with Image.open(one) as a, Image.open(two) as b:
        found.pictures(a, b, where)
        dots = [np.round(picture.info.get("dpi", (0, 0)), 2).tolist() for picture in (a, b)]
        found.same(dots[0], dots[1], f"{where} dots per inch")


def compare_gif(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare the frames' pixels and durations."""
    with Image.open(one) as a, Image.open(two) as b:
        frames = [
            [
                (frame.convert("RGBA"), frame.info.get("duration"))
                for frame in ImageSequence.Iterator(film)
            ]
            for film in (a, b)
        ]
    was, now = ([duration for _, duration in film] for film in frames)
    found.same(was, now, f"{where}: durations")
    if len(frames[0]) == len(frames[1]):
        for number, ((was, _), (now, _)) in enumerate(zip(*frames, strict=True)):
            found.pictures(was, now, f"{where} frame {number}")


def compare_pdf(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare the pages' sizes and their pixels at 144 dots an inch."""
    import pypdfium2

    pages = [list(pypdfium2.PdfDocument(path)) for path in (one, two)]
    sizes = [[page.get_size() for page in document] for document in pages]
    if len(sizes[0]) != len(sizes[1]):
        found.wrong.append(f"{where} has {len(sizes[1])} pages, had {len(sizes[0])}")
        return
    found.numbers(sizes[0], sizes[1], f"{where}: sizes of pages")
    for number, (was, now) in enumerate(zip(*pages, strict=True)):
        drawn = [page.render(scale=2).to_pil() for page in (was, now)]
        found.pictures(drawn[0], drawn[1], f"{where} page {number}")


def compare_html(one: Path, two: Path, where: str, found: Finding) -> None:
    """Compare the files that a page refers to: words and layout may change."""
    refers = [
        sorted(set(re.findall(r'(?:src|href)="([^"#:]+)"', path.read_text())))
        for path in (one, two)
    ]
    found.exact = False
    found.same(refers[0], refers[1], f"{where}: what it refers to")


FORMATS: dict[str, Callable[[Path, Path, str, Finding], None]] = {
    ".json": compare_json,
    ".geojson": compare_json,
    ".jsonl": compare_records,
    ".csv": compare_csv,
    ".safetensors": compare_safetensors,
    ".svg": compare_svg,
    ".dxf": compare_dxf,
    ".png": compare_png,
    ".gif": compare_gif,
    ".pdf": compare_pdf,
    ".html": compare_html,
}
