"""The real data of the density benchmarks, in the units of their spaces."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from common import DATA, HELD, needed
from numpy.typing import NDArray

Data = NDArray[np.float64]
Log = Callable[[Data], Data]

TORI = ("general", "glycine", "proline", "prepro")
EARTH = ("quakes", "fire")
MORE_EARTH = ("volerup", "flood")

ROUNDED = 0.01
"""Radians, of the backbone angles."""


class Drawn(NamedTuple):
    """Rows of a data set.

    - `data`: (N, k) in the units of `space`.
    - `log_density`: where it is known.
    - `trained`: rows to train on, default nine tenths.
    - `group`: (N,) the protein, molecule or place of each row.
    """

    data: Data
    space: str
    log_density: Log | None = None
    trained: int | None = None
    group: NDArray[np.integer] | None = None


def _file(name: str, what: str) -> Path:
    return needed(DATA / "density" / name, what)


class Residue(NamedTuple):
    """One-letter name, phi and psi in radians (nan where there is none), the number of its chain."""

    name: str
    phi: float
    psi: float
    chain: int


def residues() -> list[Residue]:
    """Of the Top500 proteins, in sequence."""
    found, number = [], 0
    path = _file("torus/pyro_top500/top500.txt", "the Top500 backbones")
    for line in path.read_text().splitlines():
        if line.startswith("#"):
            number += 1
            continue
        cells = line.split()
        phi, psi = cells[2:4] if len(cells) >= 4 else ("-", "-")
        found.append(Residue(cells[0], _angle(phi), _angle(psi), number))
    return found


def _angle(cell: str) -> float:
    return float(cell) if re.match(r"-?\d", cell) else math.nan


def backbone(kind: str) -> Data:
    """phi, psi (N, 2) in radians of the Top500 proteins: a residue class of the benchmark."""
    return backbone_and_chains(kind)[0]


def backbone_and_chains(kind: str) -> tuple[Data, NDArray[np.int64]]:
    """phi, psi (N, 2) in radians, and the number (N,) of the protein's chain."""
    wanted = {
        "glycine": lambda name, _: name == "G",
        "proline": lambda name, _: name == "P",
        "prepro": lambda name, after: name not in "GP" and after == "P",
        "general": lambda name, after: name not in "GP" and after != "P",
    }[kind]
    every = residues()
    rows = [
        own
        for own, after in zip(every, [*every[1:], Residue("", 0, 0, -1)], strict=True)
        if math.isfinite(own.phi + own.psi)
        and wanted(own.name, after.name if after.chain == own.chain else "")
    ]
    angles = np.array([(row.phi, row.psi) for row in rows])
    return dequantised(angles), np.array([row.chain for row in rows])


def dequantised(angles: Data) -> Data:
    """Angles that are rounded to `ROUNDED`, with uniform noise of that width, always the same.

    Else a kernel narrow enough scores any number of nats on rounded points that come back in the test
    part (as is usual for pixels: Theis, van den Oord, Bethge, 2016).
    """
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, angles.shape)
    return np.remainder(angles + ROUNDED * noise + np.pi, 2 * np.pi) - np.pi


def backbone_chains() -> list[Data]:
    """phi, psi (L, 2) in radians of each chain of the Top500 proteins, with gaps of not a number."""
    chains: dict[int, list[tuple[float, float]]] = {}
    for row in residues():
        chains.setdefault(row.chain, []).append((row.phi, row.psi))
    return [np.array(rows) for rows in chains.values()]


def earth(kind: str) -> Data:
    """lat, lon (N, 2) in degrees of earthquakes, wildfires, volcanic eruptions or floods."""
    name = {"quakes": "quakes_all"}.get(kind, kind)
    lines = _file(f"earth/{name}.csv", "the tables of the earth").read_text().splitlines()
    return np.array(
        [[float(x) for x in line.split(",")] for line in lines if re.match(r"-?[\d.]+,", line)]
    )


def rna() -> Data:
    """Seven torsion angles (N, 7) in degrees."""
    return np.loadtxt(_file("torus/rna.tsv", "the torsion angles of RNA"), usecols=range(2, 9))


def rna_structures() -> NDArray[np.str_]:
    """The structure (N,) that each row of `rna` is of."""
    path = _file("torus/rna.tsv", "the torsion angles of RNA")
    return np.loadtxt(path, usecols=0, dtype=str)


def rna_angles() -> Drawn:
    """Seven angles of RNA residues, in radians."""
    _, group = np.unique(rna_structures(), return_inverse=True)
    return Drawn(np.radians(rna()), "torus", group=group)


def rotamers(name: str, angles: int, count: int) -> Drawn:
    """Backbone and side-chain angles of the Top8000 proteins, in radians."""
    path = _file(f"torus/top8000/rota8000-{name}.csv", "the rotamers")
    rows = []
    with path.open() as file:
        for row in csv.reader(file):
            try:
                rows.append([float(cell) for cell in row[1 : 1 + angles]])
            except ValueError:  # a missing angle
                continue
    order = np.random.default_rng(8).permutation(len(rows))[:count]
    return Drawn(np.radians(np.array(rows))[order], "torus")


def sidechains(dim: int) -> Drawn:
    """Torsion angles of neighbouring residues with their side chains, from the repository.

    4, 5 and 6 are phi, psi and two, three, four chi of one residue; 7 has phi, psi and three chi of one
    and phi, psi of the next; from 8 on there are two residues, from 13 three, at most four apart.
    """
    with np.load(HELD / "sidechains.npz", allow_pickle=False) as arrays:
        angles = np.radians(arrays[f"angles_{dim}"] / 100)
        _, group = np.unique(arrays[f"structure_{dim}"], return_inverse=True)
    return Drawn(angles, "torus", group=group)


def backbone_windows(dim: int) -> Drawn:
    """phi, psi of half as many residues in sequence, from the Top500 proteins; no residue twice."""
    count, rows, group = dim // 2, [], []
    for number, chain in enumerate(backbone_chains()):
        at = 0
        while at + count <= len(chain):
            part = chain[at : at + count]
            if np.isfinite(part).all():
                rows.append(part.ravel())
                group.append(number)
                at += count
            else:
                at += 1
    return Drawn(dequantised(np.array(rows)), "torus", group=np.array(group))


def splits(data: Data, count: int = 5, *, grouped: bool = False) -> list[tuple[Data, Data, Data]]:
    """Random 80/10/10 splits; `grouped` keeps equal rows together."""
    found = []
    _, group = np.unique(data, axis=0, return_inverse=True)
    unit = group.ravel() if grouped else np.arange(len(data))
    for seed in range(count):
        order = np.random.default_rng(seed).permutation(unit.max() + 1)[unit]
        cut = np.array([0.8, 0.9]) * (unit.max() + 1)
        parts = [order < cut[0], (order >= cut[0]) & (order < cut[1]), order >= cut[1]]
        found.append(tuple(data[part] for part in parts))
    return found
