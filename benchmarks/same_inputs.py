"""The files that the cases of `same.py` read: bundled silhouettes, the heads of tables, made tables."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from same_cases import FITS

SQUIRREL = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 667 805">
<path fill="#1d1a16" opacity="0.5" d="M0 0 L300 400 C400 200 500 700 200 600 Z"/>
<circle cx="500" cy="150" r="60" fill="#c33"/>
<path fill="none" stroke="#069" stroke-width="20" d="M50 750 Q300 500 600 700"/>
</svg>
"""
"""A drawing over the squirrel, in the frame of its bounding box."""


def write_inputs(folder: Path, examples: Path) -> None:
    """Write the files that cases read: bundled silhouettes, cut tables, made tables.

    Every run writes the same: their bytes tell whether results in a cache are still good.
    """
    folder.mkdir(parents=True)
    silhouettes = examples / "silhouettes"
    nagata = silhouettes / "nagata"
    for path in (
        *(silhouettes / name for name in ("squirrel.dat", "turtle.png", "night-monkey.png")),
        silhouettes / "barbet.svg",
        nagata / "bat_60.dat",
    ):
        shutil.copy(path, folder)
    shutil.copy(examples / "artwork" / "barbet.svg", folder / "drawing.svg")
    (folder / "silhouettes").mkdir()
    for name in ("camel_60.dat", "dolphin_60.dat", "penguin_60.dat"):
        shutil.copy(nagata / name, folder / "silhouettes")
    _write_pictures(folder, silhouettes)
    _write_tables(folder, examples / "density")


def _write_pictures(folder: Path, silhouettes: Path) -> None:
    (folder / "squirrel.svg").write_text(SQUIRREL)
    mask = Image.new("L", (192, 192), 0)
    ImageDraw.Draw(mask).ellipse((60, 20, 120, 80), fill=255)
    mask.save(folder / "white.png")
    alpha = Image.open(silhouettes / "night-monkey.png").getchannel("A")
    alpha.point([0] * 128 + [230] * 128).save(folder / "inverted.png")  # light on black


def _write_tables(folder: Path, examples: Path) -> None:
    draw = np.random.default_rng(0)
    for name, rows in (("backbone.csv", 400), ("patches.csv", 400), ("poles.csv", 400)):
        lines = (examples / name).read_text().splitlines()
        (folder / name).write_text("\n".join(lines[: rows + 1]) + "\n")
    one = np.append(draw.vonmises(1, 3, 150), draw.vonmises(-2, 9, 100))
    _write(folder / "torus1.csv", "angle", one[draw.permutation(250)][:, None])
    (folder / "tables").mkdir()
    for name, at in (("first", 0.0), ("second", 2.0)):
        _write(folder / "tables" / f"{name}.csv", "u,v", draw.vonmises([at, 1], 4, (120, 2)))
    three = draw.vonmises([0, 1, -2], [4, 2, 8], (300, 3)) / (2 * np.pi)
    _write(
        folder / "torus3.csv", "a,b,c,w", np.column_stack([three, draw.uniform(1, 3, 300)]), holes=7
    )
    for name, shift in (("torus4", 0.0), ("other4", 0.3)):
        state = draw.integers(0, 3, (300, 4)) * 2.1
        state[:, 1:] += 0.5 * state[:, :-1]
        angles = np.degrees(np.angle(np.exp(1j * (draw.vonmises(0, 12, (300, 4)) + state + shift))))
        _write(
            folder / f"{name}.csv", "a,b,c,d,who", np.column_stack([angles, np.arange(300) // 10])
        )
        if not shift:
            _write(folder / "holes.csv", "a,b,c,d", angles[:40], holes=3)
    ends = draw.normal([1.0, 0.5, 0.2], 0.5, (300, 3))
    ends /= np.linalg.norm(ends, axis=1, keepdims=True)
    _write(folder / "vectors.csv", "x,y,z", ends, digits=12)
    more = draw.normal([-1.0, 0.3, 0.7], 0.7, (350, 3))
    more /= np.linalg.norm(more, axis=1, keepdims=True)
    degrees = np.degrees([np.arcsin(more[:, 2]), np.arctan2(more[:, 1], more[:, 0])]).T
    _write(folder / "sphere.csv", "lat,lon", degrees)
    _write(folder / "pixels.csv", "", draw.normal(size=(60, 9)) + np.tile([-1.5, 0, 1.5], 3))
    for table in {line.split()[0] for line in FITS.values()}:
        rows = [line for line in (folder / table).read_text().splitlines() if ",," not in line]
        complete = [row for row in rows if not row.startswith(",")]
        (folder / f"query-{table}").write_text("\n".join(complete[:61]) + "\n")


def _write(path: Path, names: str, rows: np.ndarray, *, holes: int = 0, digits: int = 6) -> None:
    lines = [[f"{value:.{digits}f}" for value in row] for row in rows]
    for at in range(0, len(lines) if holes else 0, holes or 1):
        lines[at][at // holes % 3] = ""
    head = [names] if names else []
    path.write_text("\n".join([*head, *(",".join(line) for line in lines)]) + "\n")
