"""The silhouette of a project: read from its input, mended by brush, and kept in a file."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from PIL import Image, ImageDraw, ImageFilter

from orbiflow import __version__
from orbiflow.drawing import DEFAULT_PALETTE, palette, png_bytes
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import write_atomic, write_json
from orbiflow.studio.words import OF_PICTURE, page_words
from orbiflow.tiles import (
    Emphasis,
    FileContent,
    Pins,
    ReadingSettings,
    Target,
    are_told_apart,
    doubts,
    open_image,
    page_picture,
    parts_left_out,
    polygons_in,
)

BACKDROP_SIDE_PIXELS = 1200  # pixels of the backdrop's longer side
SAMPLED_PIXELS = 400  # along a side, where it is asked for colours
MIN_CONTRAST = 48  # of 255, of a colour that is another one
EDGE_PIXELS = 7  # of these, twice as wide as what an outline's soft edge takes, and one
MIN_COLOURED_SHARE = 0.005  # of a silhouette without its edge: an eye
SUPERSAMPLING = 3  # along each side of a pixel of what is drawn
ABOUT_PARTS = ("kept the largest", "filled ")  # how notes on parts and holes begin
GUESSED = ("photograph:", "only ")  # how notes begin on what may be another part of a picture
PAPER, INK = (255, 255, 255), (70, 78, 92)


def input_file(home: Path, number: int = 0) -> Path:
    """Return the file that was uploaded as the first or second picture."""
    file = next(home.glob(f"input{OF_PICTURE[number]}.*"), None)
    if file is None:
        raise InputFileError("there is no picture yet; choose one first")
    return file


def has_second(home: Path) -> bool:
    """Whether a project has a second picture."""
    return any(home.glob(f"input{OF_PICTURE[1]}.*"))


def silhouette_file(home: Path, number: int = 0) -> Path:
    """Return the file of what was read of a picture."""
    return home / f"silhouette{OF_PICTURE[number]}.json"


def read_input(home: Path, called: str, reading: ReadingSettings, number: int = 0) -> Target:
    """Read one of a project's pictures and write its backdrop and its silhouette.

    What was read is kept, so that after a stroke only what was painted is looked at.
    """
    content = FileContent(input_file(home, number).read_bytes(), called)
    end, file = OF_PICTURE[number], silhouette_file(home, number)
    backdrop = home / f"backdrop{end}.png"
    key = [
        hashlib.sha256(content.data).hexdigest(),
        called,
        reading.threshold,
        reading.invert,
        __version__,
    ]
    earlier = json.loads(file.read_text()).get("read", {}) if file.exists() else {}
    if earlier.get("key") == key and backdrop.is_file():
        target, picture = _loaded(earlier["target"]), Image.open(backdrop)
        picture.load()  # which closes the file
    else:
        target = _framed(
            Target.from_bytes(
                content.data, called, threshold=reading.threshold, invert=reading.invert
            )
        )
        picture = _picture(target, content)
        drawn = png_bytes(picture)
        # one that stays is not loaded again by the page
        if not backdrop.is_file() or backdrop.read_bytes() != drawn:
            write_atomic(backdrop, drawn)
    mended = reading.shaped(_mended(target, home / f"mend{end}.png", picture.size))
    document = {
        "shown": _shown(mended, target, picture),
        "target": _stored(mended),
        "read": {"key": key, "target": _stored(target)},
    }
    write_json(file, document)
    return mended


def _framed(target: Target) -> Target:
    """Return a polygon with a page of its own size, which stays when it is mended."""
    if target.size is not None:
        return target
    low, high = target.covered.low, target.covered.high
    (width, height), corner = (high - low).tolist(), low.tolist()
    return replace(target, size=(width, height), corner=tuple(corner))


def load_target(home: Path, number: int = 0) -> Target:
    """Return the silhouette of a picture, as it was read last."""
    try:
        stored = json.loads(silhouette_file(home, number).read_text())["target"]
    except FileNotFoundError:
        raise InputFileError("there is no silhouette yet; choose a picture first") from None
    return _loaded(stored)


def _loaded(stored: dict[str, Any]) -> Target:
    stored["outline"] = np.array(stored["outline"])
    stored["seen"] = shapely.from_wkt(stored.get("seen"))
    stored["size"] = stored["size"] and tuple(stored["size"])
    return Target(**{**stored, "corner": tuple(stored["corner"]), "notes": tuple(stored["notes"])})


def why_not_painted(home: Path, mask: str, number: int = 0) -> str:
    """Return why a search would refuse what is painted over a picture, "" if it takes it."""
    file = home / f"{mask}{OF_PICTURE[number]}.png"
    if mask == "mend" or not file.exists() or not silhouette_file(home, number).exists():
        return ""
    try:
        target = load_target(home, number)
        if mask == "pins":
            Pins.read([file], target)
        else:
            Emphasis.read(file, target)
    except OrbiflowError as error:
        return page_words(str(error)).replace(f"{home}{os.sep}", "")
    return ""


def marks_of(home: Path) -> list[str]:
    """Return what tells each of a project's silhouettes, as it was read last, from every other."""
    files = [silhouette_file(home), *[silhouette_file(home, 1)] * has_second(home)]
    return [json.loads(file.read_text())["shown"].get("mark", "") for file in files]


def _stored(target: Target) -> dict[str, Any]:
    names = ("y_down", "kind", "size", "notes", "corner", "source")
    seen = None if target.seen is None else target.seen.wkt
    return {
        "outline": target.outline.tolist(),
        "seen": seen,
        **{name: getattr(target, name) for name in names},
    }


def _picture(target: Target, content: FileContent) -> Image.Image:
    """Return the picture that the user is shown below the silhouette."""
    if target.kind == "image":
        picture, _ = open_image(content, enough=BACKDROP_SIDE_PIXELS)
        picture = picture.convert("RGBA" if picture.mode == "RGBA" else "RGB")
        picture.thumbnail((BACKDROP_SIDE_PIXELS, BACKDROP_SIDE_PIXELS))
        return picture
    extent = target.covered.high - target.covered.low
    width, height = (
        np.maximum(1, np.round(extent * BACKDROP_SIDE_PIXELS / extent.max())).astype(int).tolist()
    )
    if target.kind == "svg":
        with suppress(InputFileError):  # too intricate for colours: what was read is shown in one
            return page_picture(content, target.covered, (width, height))
    return _drawn(target, (width, height), "RGB", INK, PAPER)


def _drawn(target: Target, size: tuple[int, int], mode: str, ink: Any, paper: Any) -> Image.Image:
    """Return what was read as shape, filled."""
    width, height = finer = size[0] * SUPERSAMPLING, size[1] * SUPERSAMPLING
    picture = Image.new(mode, (width, height), paper)
    draw = ImageDraw.Draw(picture)

    def points(ring: Any) -> list[tuple[float, ...]]:
        # Pillow's whole numbers are the middles of pixels
        return list(map(tuple, (target.covered.shares(np.asarray(ring)) * finer - 0.5).tolist()))

    for part in [] if target.seen is None else polygons_in(target.seen):
        draw.polygon(points(part.exterior.coords), fill=ink)
        for hole in part.interiors:
            draw.polygon(points(hole.coords), fill=paper)
    if target.seen is None:
        draw.polygon(points(target.outline), fill=ink)
    return picture.reduce(SUPERSAMPLING)


def _mended(target: Target, file: Path, size: tuple[int, int]) -> Target:
    """Return the silhouette with what was painted white added and what was painted black removed."""
    if not file.exists():
        return target
    painted, _ = open_image(FileContent(file.read_bytes(), "the corrections"))
    painted = painted.convert("RGBA").resize(size, Image.Resampling.NEAREST)
    level, _, _, opacity = (np.asarray(band) > 127 for band in painted.split())
    drawn = _drawn(target, size, "L", 255, 0)
    mask = (np.asarray(drawn) > 127) & ~(opacity & ~level) | (opacity & level)
    mask = np.pad(mask, 1)  # the shape may touch the picture's edge
    if not mask.any():
        raise InputFileError("nothing of the picture is left; paint some of it back")
    mended = Target.from_mask(mask, source=target.source)

    def placed(points: Any) -> Any:
        return target.covered.at((np.asarray(points) - 1) / size)

    kept = [note for note in target.notes if not note.startswith(ABOUT_PARTS)]
    notes = (*kept, *(note for note in mended.notes if note.startswith(ABOUT_PARTS)))
    seen = None if mended.seen is None else shapely.transform(mended.seen, placed)
    return replace(target, outline=placed(mended.outline), notes=notes, seen=seen)


def _sampled(picture: Image.Image, by: Image.Resampling | None = None) -> Any:
    """Return the colours of a picture on paper at few pixels, (N, N, 3) from 0 to 255."""
    size = SAMPLED_PIXELS, SAMPLED_PIXELS
    paper = Image.new("RGBA", size, (*PAPER, 255))
    laid = Image.alpha_composite(paper, picture.convert("RGBA").resize(size, by))
    return np.asarray(laid.convert("RGB"), dtype=float)


def _inside(ring: Any, picture: Image.Image) -> Image.Image:
    """Return where these pixels are inside of a ring."""
    mask = Image.new("L", (SAMPLED_PIXELS, SAMPLED_PIXELS))
    shares = np.asarray(ring) / picture.size * SAMPLED_PIXELS
    ImageDraw.Draw(mask).polygon(list(map(tuple, shares.tolist())), fill=255)
    return mask


def _is_coloured(picture: Image.Image, ring: Any, read: Any) -> bool:
    """Whether a picture has several colours inside of a ring, such as eyes and lines.

    The background counts only where it lies inside of what was `read`, not where that was mended.
    """
    colours = _sampled(picture, Image.Resampling.NEAREST)  # holes are eyes

    def covered(points: Any, edge: ImageFilter.Filter) -> Any:
        return np.asarray(_inside(points, picture).filter(edge)) > 0

    def differing(of: Any) -> Any:
        return np.abs(colours - np.median(colours[of], axis=0)).max(axis=2) > MIN_CONTRAST

    inner, outer = ImageFilter.MinFilter(EDGE_PIXELS), ImageFilter.MaxFilter(EDGE_PIXELS)
    inside, around = covered(ring, inner), ~covered(read, outer)  # without the soft edge
    if not inside.any():
        return False
    counts = covered(read, inner)
    if around.any():
        counts |= around & differing(around)
    others = inside & counts & differing(inside)
    return bool(others.sum() > MIN_COLOURED_SHARE * inside.sum())


def _are_told_apart(picture: Image.Image, ring: Any) -> bool:
    """Whether copies that carry what lies in a ring of a picture can be told apart."""
    colours, inside = _sampled(picture), np.asarray(_inside(ring, picture)) > 0
    outline = palette(DEFAULT_PALETTE).outline
    return are_told_apart(colours / 255, inside, outline)


def _shown(target: Target, read: Target, picture: Image.Image) -> dict[str, Any]:
    """Return what a browser needs of the silhouette, in pixels of the backdrop.

    `read`: the silhouette before it was mended.
    """
    size = picture.size

    def pixels(ring: Any) -> list[list[float]]:
        return np.round(target.covered.shares(np.asarray(ring)) * size, 2).tolist()

    lost, doubted = parts_left_out(target), [page_words(text) for text in doubts(target)]
    # what the page says of these in other words
    twice = ("kept the largest",) * bool(lost) + ("filled ",) * ("holes were" in "".join(doubted))
    outline = pixels(target.outline)
    is_coloured = _is_coloured(picture, outline, pixels(read.outline))
    is_cut_out = target.kind != "image" or picture.mode == "RGBA"
    is_guessed = any(note.startswith(GUESSED) for note in target.notes)
    return {
        "outline": outline,
        "mark": hashlib.sha256(json.dumps(outline).encode()).hexdigest()[:12],
        "coloured": is_coloured,
        "clear": (is_cut_out or not is_coloured) and not (lost or doubted or is_guessed),
        "told_apart": _are_told_apart(picture, outline),
        "width": size[0],
        "height": size[1],
        "notes": [page_words(note) for note in target.notes if not note.startswith(twice)],
        "left_out": [pixels(part.exterior.coords) for part in lost],
        "doubts": doubted,
    }
