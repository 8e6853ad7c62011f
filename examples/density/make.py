"""Makes the tables of this folder from their sources (README.md says where those come from).

    python examples/density/make.py TOP8000_FOLDER nk15c30Dct.mat dsdp522_sites_with_vgps.txt

Same sources, same tables, up to rounding in a few rows of patches.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np
import scipy.io

HERE = Path(__file__).parent
RESIDUES = 20_000


def backbone(folder: Path) -> None:
    """phi, psi in degrees of histidine, methionine and tryptophan: a random choice of the rows."""
    angles = []
    for residue in ("his", "met", "trp"):
        for line in (folder / f"rota8000-{residue}.csv").read_text().splitlines():
            angles.append([float(cell) for cell in line.split(",")[1:3]])
    rows = np.sort(np.random.default_rng(0).choice(len(angles), RESIDUES, replace=False))
    write("backbone.csv", "phi,psi", np.array(angles)[rows], "%.3f")


def patches(path: Path) -> None:
    """theta, phi in radians of image patches, and their distance to the Klein bottle."""
    page = (HERE.parents[1] / "docs/examples/image-patches.md").read_text(encoding="utf-8")
    names = {}
    exec(re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)[0], names)
    coordinates = scipy.io.loadmat(path)["nk15c30Dct"]
    write("patches.csv", "theta,phi,distance", names["to_klein"](coordinates @ dct().T), "%.5f")


def dct() -> np.ndarray:
    """The basis (9, 8) of Lee, Pedersen and Mumford: pixels row by row, of contrast 1 and mean 0."""
    flat, slope, bend = np.array([[1, 1, 1], [1, 0, -1], [1, -2, 1]], dtype=float)
    down = (flat, slope, flat, bend, slope, bend, slope, bend)
    along = (slope, flat, bend, flat, slope, slope, bend, bend)
    lengths = np.sqrt([6, 6, 54, 54, 8, 48, 48, 216])
    return np.stack([np.outer(a, b).ravel() for a, b in zip(down, along, strict=True)], 1) / lengths


def poles(path: Path) -> None:
    """lat, lon in degrees of virtual geomagnetic poles, of the sites that have one."""
    _, header, *lines = path.read_text().splitlines()
    names = header.split("\t")
    columns = [names.index("vgp_lat"), names.index("vgp_lon")]
    rows = [[line.split("\t")[k] for k in columns] for line in lines]
    found = np.array([[float(cell) for cell in row] for row in rows if all(row)])
    write("poles.csv", "lat,lon", found, "%.4f")


def write(name: str, header: str, values: np.ndarray, form: str) -> None:
    """A CSV in this folder."""
    np.savetxt(HERE / name, values, fmt=form, delimiter=",", header=header, comments="")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        raise SystemExit(__doc__)
    backbone(Path(sys.argv[1]))
    patches(Path(sys.argv[2]))
    poles(Path(sys.argv[3]))
