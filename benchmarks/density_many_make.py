"""Makes data/sidechains.npz: torsion angles of residues and of neighbouring residues, T4 to T14.

    python benchmarks/density_many_make.py TOP8000_FOLDER

The folder holds rota8000-{gln,his,lys-1m,met,trp}.csv (docs/benchmarks.md says where to get them).
Same sources, same arrays.
"""

from __future__ import annotations

import csv
import re
import sys
from itertools import chain, pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

HERE = Path(__file__).parent / "data" / "sidechains.npz"

SIDE = {"his": 2, "trp": 2, "gln": 3, "met": 3, "lys-1m": 4}
"""Side-chain angles of each residue type that there is."""

APART = 4
"""Residues, at most, between one residue of a window and the next."""

ROWS = 4_000
"""Of each set, at most."""

WINDOWS = {
    4: "2",
    5: "3",
    6: "4",
    8: "22",
    9: "23",
    10: "33",
    11: "34",
    12: "44",
    13: "223",
    14: "233",
}
"""Side-chain angles of the residues of a window, by the number of all its angles."""


class Residue(NamedTuple):
    """A chain (structure, letter), the number in it and the angles in degrees: phi, psi, chi."""

    chain: tuple[str, str]
    number: int
    angles: list[float]


def residues(folder: Path) -> dict[tuple[str, str], dict[int, Residue]]:
    """Of each chain, by their numbers."""
    found: dict[tuple[str, str], dict[int, Residue]] = {}
    for name, side in SIDE.items():
        with (folder / f"rota8000-{name}.csv").open() as file:
            for row in csv.reader(file):
                place = re.match(r"(\w{4}) (\S) *(-?\d+) ", row[0])
                if place:  # numbers with letters are left out
                    key, number = (place[1], place[2]), int(place[3])
                    angles = [float(cell) for cell in row[1 : 3 + side]]
                    found.setdefault(key, {})[number] = Residue(key, number, angles)
    return found


def windows(chains: dict[tuple[str, str], dict[int, Residue]], kind: str) -> list[list[Residue]]:
    """Neighbouring residues of these numbers of side-chain angles, each residue in one window at most.

    A residue's window goes on with the next one that there is, at most `APART` further on; those with
    fewer side-chain angles come first.
    """
    found = []
    for own in chains.values():
        numbers = sorted(own)
        at = 0
        while at + len(kind) <= len(numbers):
            part = numbers[at : at + len(kind)]
            near = max(np.diff(part), default=0) <= APART
            chosen = sorted((own[n] for n in part), key=lambda r: len(r.angles))
            if near and "".join(str(len(r.angles) - 2) for r in chosen) == kind:
                found.append(chosen)
                at += len(kind)
            else:
                at += 1
    return found


def with_backbone(chains: dict[tuple[str, str], dict[int, Residue]]) -> list[list[Residue]]:
    """Residues of three side-chain angles, and the backbone of the next one: seven angles."""
    found = []
    for own in chains.values():
        numbers = sorted(own)
        for first, second in pairwise(numbers):
            if len(own[first].angles) == 5 and second - first <= APART:
                after = own[second]
                found.append([own[first], after._replace(angles=after.angles[:2])])
    return found


def main() -> None:
    """Write the file."""
    if len(sys.argv) != 2:
        raise SystemExit(__doc__)
    chains = residues(Path(sys.argv[1]))
    structures = {name: k for k, name in enumerate(sorted({key[0] for key in chains}))}
    sets = {dim: windows(chains, kind) for dim, kind in WINDOWS.items()}
    sets[7] = with_backbone(chains)
    arrays = {}
    for dim, rows in sorted(sets.items()):
        order = np.random.default_rng(dim).permutation(len(rows))[:ROWS]
        angles = np.array([list(chain(*(r.angles for r in rows[k]))) for k in order])
        turned = np.remainder(angles + 180, 360) - 180
        arrays[f"angles_{dim}"] = np.round(100 * turned).astype(np.int16)
        arrays[f"structure_{dim}"] = np.array(
            [structures[rows[k][0].chain[0]] for k in order], dtype=np.int16
        )
        print(
            f"T{dim}: {len(order)} of {len(rows)} windows, {len(set(arrays[f'structure_{dim}']))}"
            " structures"
        )
    np.savez_compressed(HERE, **arrays)


if __name__ == "__main__":
    main()
