"""The silhouettes whose tiles judges mark: outlines of 80 points, licences, and the split.

    python benchmarks/likeness_shapes.py make --packages FOLDER [--out FILE.json]
    python benchmarks/likeness_shapes.py look [--sheet FILE.png]

`make` writes data/likeness_shapes.json from four sources: the icons, the polygons of Nagata and
Imahori, the PhyloPic silhouettes (docs/benchmarks.md says where they are), and animals of eight sets
of icons, which npm unpacks into FOLDER/node_modules:

    npm install --prefix FOLDER @iconify-json/noto @iconify-json/twemoji \\
        @iconify-json/fluent-emoji-flat @iconify-json/fa6-solid @iconify-json/emojione \\
        @iconify-json/fxemoji @iconify-json/noto-v1 @iconify-json/game-icons

Drawings are filled, gaps are closed by 9 of 480 pixels, and the largest part is kept and sampled at 80
points. A third of each source is for the test alone, drawn by a fixed seed; of 38 animals (the part
"ranked") only the best tiles were ranked, and 32 more icons (the part "fresh") came last, for one
comparison. `look` draws all of them.
"""

from __future__ import annotations

import argparse
import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import resvg_py
from common import DATA, ROOT, Ring, needed
from likeness_methods import cell
from PIL import Image, ImageDraw, ImageFont
from scipy import ndimage
from skimage import measure

from orbiflow.tiles import Target, orient, resampled

SHAPES = ROOT / "benchmarks" / "data" / "likeness_shapes.json"
SEED = 25
POINTS, WIDE, MARGIN, GAP, HAIR = 80, 480, 30, 9, 3  # points; pixels

ANIMALS = {
    "noto": "ant bison black-cat deer dodo dolphin eagle elephant giraffe horse kangaroo rhinoceros "
    "rooster sauropod",
    "twemoji": "beetle butterfly crab dove lobster mammoth seal skunk snail tropical-fish turtle",
    "fluent-emoji-flat": "chipmunk goat ox shark t-rex zebra",
    "fa6-solid": "crow fish-fins frog",
}
"""Animals that a person names at once, by set of icons."""

RANKED = {
    "emojione": "ant dove horse rooster",
    "fluent-emoji-flat": "bat dodo eagle giraffe jellyfish mammoth peacock rhinoceros",
    "fxemoji": "dolphin elephant poodle",
    "noto": "boar chipmunk cricket goose gorilla guide-dog llama monarch-butterfly parrot pig shark "
    "spider t-rex turkey",
    "noto-v1": "camel elephant penguin shark",
    "twemoji": "ant honeybee rabbit sauropod t-rex",
}
"""More of them, whose best tiles were ranked (likeness_ranks.py)."""

FRESH = (
    "beaver camel cat charging-bull chicken diplodocus dodo dolphin eating-pelican elephant frog gecko "
    "goat hummingbird kangaroo lion mammoth mouse ostrich polar-bear pterodactylus rooster seagull "
    "seahorse snail sparrow swan tapir tortoise velociraptor vulture wyvern"
)
"""Of game-icons.net, beside the icons: chosen by their outlines, before any tile of them was made."""

UNNAMED = ("Grapsidae", "Hydroscaphidae")
"""PhyloPic silhouettes that nobody could name from 80 points."""

NAGATA = {"by": "Yuichi Nagata and Shinji Imahori", "licence": "MIT"}
NAGATA_PLACE = "github.com/nagata-yuichi/EscherTiling"
ICONS = {"by": "Lorc, Delapouite and contributors, game-icons.net", "licence": "CC BY 3.0"}
ICONS_PLACE = "@iconify-json/game-icons 1.2.4"


def outline(mask: np.ndarray[Any, Any]) -> Ring:
    """Return the outline (80, 2) of a mask's largest part, y up, gaps closed and holes filled."""
    closed = ndimage.binary_closing(np.pad(mask, MARGIN), _disc(GAP))
    solid = ndimage.binary_opening(ndimage.binary_fill_holes(closed), _disc(HAIR))
    parts, count = ndimage.label(solid)
    largest = 1 + int(np.argmax(ndimage.sum(solid, parts, range(1, count + 1))))
    curves = measure.find_contours((parts == largest).astype(float), 0.5)
    ring = max(curves, key=len)[:-1, ::-1] * (1.0, -1.0)
    return resampled(orient(ring), POINTS)


def _disc(radius: int) -> np.ndarray[Any, Any]:
    y, x = np.ogrid[-radius : radius + 1, -radius : radius + 1]
    return x * x + y * y <= radius * radius


def animals(packages: Path, sets: dict[str, str]) -> dict[str, dict[str, Any]]:
    """Read the animals of the sets of icons, with their licences."""
    found = {}
    for name, animals in sets.items():
        folder = needed(packages / "node_modules" / "@iconify-json" / name, f"the package {name}")
        drawn = json.loads((folder / "icons.json").read_text())
        about = json.loads((folder / "info.json").read_text())
        version = json.loads((folder / "package.json").read_text())["version"]
        for animal in animals.split():
            icon = {"left": 0, "top": 0, **drawn, **drawn["icons"][animal]}
            box = " ".join(str(icon[key]) for key in ("left", "top", "width", "height"))
            svg = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}">{icon["body"]}</svg>'
            png = bytes(resvg_py.svg_to_bytes(svg_string=svg, width=WIDE))
            alpha = np.asarray(Image.open(io.BytesIO(png)).convert("RGBA"))[..., 3]
            found[f"{name}-{animal}"] = {
                "source": f"@iconify-json/{name} {version}, {animal}",
                "by": ICONS["by"] if name == "game-icons" else about["author"]["name"],
                "licence": about["license"]["title"],
                "outline": outline(alpha > 127),
            }
    return found


def phylopic() -> dict[str, dict[str, Any]]:
    """Read the PhyloPic silhouettes, with their licences."""
    found = {}
    folder = needed(DATA / "silhouettes" / "phylopic", "the PhyloPic silhouettes")
    for path in sorted(folder.glob("*.png")):
        if path.stem in UNNAMED:
            continue
        about = json.loads(path.with_suffix(".json").read_text())
        image = about["_embedded"]["primaryImage"]
        target = Target.read(path)
        size = WIDE / np.ptp(target.normal, axis=0).max()
        picture = cell(np.asarray(target.normal), WIDE, size)
        found[path.stem] = {
            "source": f"PhyloPic {image['uuid']}",
            "by": image["_links"]["contributor"]["title"],
            "licence": image["_links"]["license"]["href"],
            "outline": outline(np.asarray(picture.convert("L")) < 128),
        }
    return found


def polygons(folder: str, place: str, about: dict[str, str]) -> dict[str, dict[str, Any]]:
    """Read the polygons of a folder."""
    return {
        path.stem: {
            "source": f"{place}, {path.name}",
            **about,
            "outline": np.asarray(Target.read(path).normal),
        }
        for path in sorted(needed(DATA / "silhouettes" / folder, "the polygons").glob("*.dat"))
    }


def split(names: list[str], rng: np.random.Generator) -> dict[str, str]:
    """Draw a third of the names, rounded, for the test."""
    tested = rng.choice(len(names), round(len(names) / 3), replace=False)
    return {name: "test" if k in tested else "learn" for k, name in enumerate(names)}


def make(options: argparse.Namespace) -> None:
    """Write the silhouettes, in their normal form, rounded to four digits."""
    sources = [polygons("icons", ICONS_PLACE, ICONS)]
    sources += [polygons("nagata", NAGATA_PLACE, NAGATA), phylopic()]
    sources += [animals(options.packages, ANIMALS)]
    rng, found = np.random.default_rng(SEED), {}
    parted = [(source, split(list(source), rng)) for source in sources]
    ranked = animals(options.packages, RANKED)
    fresh = animals(options.packages, {"game-icons": FRESH})
    parted += [(ranked, dict.fromkeys(ranked, "ranked")), (fresh, dict.fromkeys(fresh, "fresh"))]
    for source, parts in parted:
        for name, shape in source.items():
            normal = np.asarray(Target.from_polygon(shape.pop("outline")).normal)
            found[name] = {"part": parts[name], **shape, "outline": normal.round(4).tolist()}
    rows = ",\n".join(f"{json.dumps(name)}: {json.dumps(shape)}" for name, shape in found.items())
    options.out.write_text(f'{{"seed": {SEED}, "silhouettes": {{\n{rows}\n}}}}\n')
    tested = sum(shape["part"] == "test" for shape in found.values())
    print(f"{len(found)} silhouettes, {tested} of them for the test: {options.out}")


def silhouettes(path: Path = SHAPES) -> dict[str, dict[str, Any]]:
    """Return the silhouettes of the file by name: part, source, by, licence, outline."""
    return json.loads(path.read_text())["silhouettes"]


def look(options: argparse.Namespace) -> None:
    """Draw all silhouettes on one sheet."""
    size, columns, found = 140, 10, silhouettes(options.out)
    page = Image.new("RGB", (columns * size, -(-len(found) // columns) * (size + 20)), "white")
    pen, font = ImageDraw.Draw(page), ImageFont.load_default(size=13)
    for k, (name, shape) in enumerate(found.items()):
        x, y = (k % columns) * size, (k // columns) * (size + 20)
        ring = np.array(shape["outline"])
        page.paste(cell(ring, size, 0.9 * size / np.ptp(ring, axis=0).max()), (x, y + 20))
        pen.text((x + 4, y + 4), name[:20], "red" if shape["part"] == "test" else "black", font)
    options.sheet.parent.mkdir(parents=True, exist_ok=True)
    page.save(options.sheet)


def main() -> None:
    """Make the file, or draw it."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    maker = commands.add_parser("make", help="write the silhouettes")
    maker.add_argument("--packages", type=Path, required=True, help="where npm has unpacked")
    maker.set_defaults(command=make)
    looker = commands.add_parser("look", help="draw them")
    looker.add_argument("--sheet", type=Path, default=Path("out/likeness-shapes.png"))
    looker.set_defaults(command=look)
    for command in (maker, looker):
        command.add_argument("--out", type=Path, default=SHAPES)
    options = parser.parse_args()
    options.command(options)


if __name__ == "__main__":
    main()
