"""What the benchmarks of likeness compare: one tile of each method, upright, of area 1; kept on disk.

Searches are slow and drawing is not: what was found is kept in FOLDER/tiles as JSON and read from there
the next time. Remove the folder after a change of the search.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from common import DATA, ROOT, LikenessTile, Ring, aligned, goal, likeness_tiles, needed
from PIL import Image, ImageDraw

from orbiflow.tiles import OverlapSearch, Target, centroid, escherize, signed_area

METHODS = ("overlap", "likeness", "arap", "est", "trial")
"""Overlap: the flow that maximises IoU; likeness: the silhouette bends; the others' tiles are files."""

BEFORE = "before"
"""An earlier search for likeness: its first tiles lie in FOLDER/tiles as NAME-first-before.json."""

BASELINES = {"arap": "arap_EIR_top20", "est": "est_euclid_top20"}

TRIES = 8
"""Turns from which the best similarity is sought: three have missed it for a spider."""

RINGS = LikenessTile._fields[1:]
SMOOTH = 3  # pixels drawn for each pixel of a side


def kept(
    folder: Path | None, name: str, effort: str, search: Callable[[], list[LikenessTile]]
) -> list[LikenessTile]:
    """The tiles of a search for likeness, from FOLDER if they are kept there, else kept now.

    Args:
        folder: None for a search every time.
        name: of the target.
        effort: of the search.
        search: what finds the tiles.
    """

    def rows() -> list[dict[str, Any]]:
        return [
            {"class": tile.name} | {part: getattr(tile, part).tolist() for part in RINGS}
            for tile in search()
        ]

    return [
        LikenessTile(row["class"], *(np.array(row[part]) for part in RINGS))
        for row in _document(folder, f"{name}-likeness-{effort}", rows)
    ]


RIVALS = ROOT / "benchmarks" / "data" / "likeness_rivals.json"
SHAPES = ROOT / "benchmarks" / "data" / "likeness_shapes.json"


def silhouette(name: str) -> Target:
    """A goal, an icon of likeness_shapes.json or, by its family's name, one of PhyloPic's twenty."""
    shape = json.loads(SHAPES.read_text())["silhouettes"].get(name)
    if shape and shape["source"].startswith("@iconify"):
        return Target.from_polygon(shape["outline"])
    if name.rpartition("_")[2].isdigit():
        return goal(name)
    folder = needed(DATA / "silhouettes" / "phylopic", "the twenty PhyloPic silhouettes")
    return Target.read(needed(folder / f"{name}.png", f"the silhouette {name}"))


def phylopic_names() -> list[str]:
    """Names of the twenty."""
    folder = needed(DATA / "silhouettes" / "phylopic", "the twenty PhyloPic silhouettes")
    return sorted(path.stem for path in folder.glob("*.png"))


def first_tiles(
    name: str, effort: str, folder: Path | None, methods: tuple[str, ...] = METHODS
) -> dict[str, Ring]:
    """Of "target" and of each method that has one, its first tile: y up, area 1, upright.

    Args:
        name: of a goal or a PhyloPic silhouette.
        effort: of the searches for overlap and for likeness.
        folder: where tiles are kept.
        methods: which are asked for.
    """
    target = silhouette(name)
    outline = np.asarray(target.normal)
    found = {"target": outline}
    for method in methods:
        ours = method in ("overlap", "likeness")
        ring = _document(
            folder,
            f"{name}-first-{method}" + (f"-{effort}" if ours else ""),
            lambda m=method: _first(name, target, m, effort, folder),
        )
        if ring:
            found[method] = of_area_one(np.array(ring))
    return found


def _first(
    name: str, target: Target, method: str, effort: str, folder: Path | None
) -> list[list[float]]:
    """The first tile of one method laid on the target, or nothing."""
    outline = np.asarray(target.normal)
    if method == "overlap":
        results = escherize(target, method=OverlapSearch.for_effort(effort)).tiles
        return results[0].normal_tile.polygon.tolist() if results else []
    if method == "likeness":
        tiles = kept(folder, name, effort, lambda: likeness_tiles(target, effort))
        return aligned(tiles[0].ring, outline, TRIES).tolist() if tiles else []
    if method == BEFORE:
        raise SystemExit(f"{name}: there is no {folder}/tiles/{name}-first-{BEFORE}.json")
    if method in BASELINES:
        tile = baseline(name).get(method)
        return aligned(np.array(tile["tile"]), outline, TRIES).tolist() if tile else []
    path = DATA / "silhouettes" / "trial_tiles.json"
    trial = json.loads(path.read_text()) if path.exists() else {}
    return aligned(np.array(trial[name]), outline, TRIES).tolist() if name in trial else []


def baseline(name: str) -> dict[str, dict[str, Any]]:
    """The first tiles of EST and ARAP, by method, where they are at hand."""
    icons = DATA / "silhouettes" / "icons" / "baselines.json"
    goals = DATA / "silhouettes" / "baseline_tiles" / f"{name}.json"
    if goals.exists():
        tiles = json.loads(goals.read_text())
        return {method: tiles[key][0] for method, key in BASELINES.items()}
    known = json.loads(icons.read_text()) if icons.exists() else {}
    fresh = json.loads(RIVALS.read_text()) if RIVALS.exists() else {}
    return known.get(name.removesuffix("_80")) or fresh.get(name, {})


def _document(folder: Path | None, name: str, make: Callable[[], Any]) -> Any:
    if folder is None:
        return make()
    path = folder / "tiles" / f"{name}.json"
    if not path.exists():
        document = make()
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(document))
    return json.loads(path.read_text())


def of_area_one(ring: Ring) -> Ring:
    """The ring (M, 2) with its centroid in the origin and area 1, not turned."""
    return (ring - centroid(ring)) / np.sqrt(abs(signed_area(ring)))


def cell(ring: Ring, size: int, unit: float, colour: str = "black") -> Image.Image:
    """A filled ring (M, 2), y up, in the middle of a white square of `size` pixels.

    Args:
        ring: in units of which one is `unit` pixels long.
        size: of the picture's sides.
        unit: pixels.
        colour: of the filling.
    """
    middle = (ring.min(axis=0) + ring.max(axis=0)) / 2
    pixels = ((ring - middle) * (1, -1) * unit + size / 2) * SMOOTH
    picture = Image.new("RGB", (size * SMOOTH, size * SMOOTH), "white")
    ImageDraw.Draw(picture).polygon([(float(x), float(y)) for x, y in pixels], fill=colour)
    return picture.resize((size, size), Image.Resampling.LANCZOS)


def common_unit(rings: list[Ring], size: int, share: float = 0.9) -> float:
    """Pixels for one unit so that every ring fills at most `share` of a square of `size` pixels."""
    return share * size / max(float(np.ptp(ring, axis=0).max()) for ring in rings)
