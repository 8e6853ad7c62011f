"""Makes the tables of this folder from their sources (README.md says where those come from).

    python examples/density/make.py TOP8000_FOLDER nk15c30Dct.mat dsdp522_sites_with_vgps.txt

Needs orbiflow. Same sources, same tables, byte by byte.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import scipy.io

from orbiflow import to_klein

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
    angles, distances = to_klein(scipy.io.loadmat(path)["nk15c30Dct"])
    write("patches.csv", "theta,phi,distance", np.column_stack([angles, distances]), "%.5f")


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
