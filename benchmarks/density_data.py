"""The real data of the density benchmarks, in the units of their spaces."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from common import DATA, needed
from numpy.typing import NDArray

Data = NDArray[np.float64]

TORI = ("general", "glycine", "proline", "prepro")
EARTH = ("quakes", "fire")

ROUNDED = 0.01
"""Radians, of the backbone angles."""


def _file(name: str, what: str) -> Path:
    return needed(DATA / "density" / name, what)


def backbone(kind: str) -> Data:
    """phi, psi (N, 2) in radians of the Top500 proteins: a residue class of the benchmark.

    The file's angles are rounded to `ROUNDED`. Uniform noise of that width is added, always the same:
    else a kernel narrow enough scores any number of nats on rounded points that come back in the test
    part (dequantisation, as is usual for pixels: Theis, van den Oord, Bethge, 2016).
    """
    rows: list[tuple[str, float, float, str]] = []
    chain: list[tuple[str, str, str]] = []

    def close() -> None:
        for (name, phi, psi), (after, *_) in zip(
            chain, [*chain[1:], ("", "", "")][: len(chain)], strict=True
        ):
            if re.match(r"-?\d", phi) and re.match(r"-?\d", psi):
                rows.append((name, float(phi), float(psi), after))
        chain.clear()

    for line in (
        _file("torus/pyro_top500/top500.txt", "the Top500 backbones").read_text().splitlines()
    ):
        if line.startswith("#"):
            close()
            continue
        name, _, phi, psi = line.split()[:4] if len(line.split()) >= 4 else (*line.split(), "-")[:4]
        chain.append((name, phi, psi))
    close()
    wanted = {
        "glycine": lambda name, _: name == "G",
        "proline": lambda name, _: name == "P",
        "prepro": lambda name, after: name not in "GP" and after == "P",
        "general": lambda name, after: name not in "GP" and after != "P",
    }[kind]
    angles = np.array([(phi, psi) for name, phi, psi, after in rows if wanted(name, after)])
    noise = np.random.default_rng(0).uniform(-0.5, 0.5, angles.shape)
    return np.remainder(angles + ROUNDED * noise + np.pi, 2 * np.pi) - np.pi


def earth(kind: str) -> Data:
    """lat, lon (N, 2) in degrees of earthquakes or wildfires."""
    name = {"quakes": "quakes_all", "fire": "fire"}[kind]
    lines = _file(f"earth/{name}.csv", "the earthquakes and wildfires").read_text().splitlines()
    return np.array(
        [[float(x) for x in line.split(",")] for line in lines if re.match(r"-?[\d.]+,", line)]
    )


def rna() -> Data:
    """Seven torsion angles (N, 7) in degrees."""
    return np.loadtxt(_file("torus/rna.tsv", "the torsion angles of RNA"), usecols=range(2, 9))


def poles() -> Data:
    """Virtual geomagnetic poles (N, 2), lat and lon in degrees: of both polarities, so axes."""
    lines = _file("rp2/dsdp522_sites_with_vgps.txt", "the magnetic poles").read_text().splitlines()
    header = lines[1].split("\t")
    at = [header.index("vgp_lat"), header.index("vgp_lon")]
    rows = [line.split("\t") for line in lines[2:]]
    return np.array([[float(row[i]) for i in at] for row in rows if all(row[i] for i in at)])


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
