"""Angles of proteins and of a known density on tori of four to fourteen angles."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from density_data import Data, backbone_chains, dequantised, rna, rna_structures
from density_default_data import Drawn
from numpy.typing import NDArray
from scipy.special import ive, logsumexp

BUNDLED = Path(__file__).parent / "data" / "sidechains.npz"

STATES, KNOWN_ROWS = 4, 4_000


class Grouped(NamedTuple):
    """Rows, and the protein or molecule (N,) of each where there is one."""

    drawn: Drawn
    group: NDArray[np.integer] | None = None


def sidechains(dim: int) -> Grouped:
    """Torsion angles of neighbouring residues with their side chains, from the repository.

    4, 5 and 6 are phi, psi and two, three, four chi of one residue; 7 has phi, psi and three chi of one
    and phi, psi of the next; from 8 on there are two residues, from 13 three, at most four apart.
    """
    with np.load(BUNDLED, allow_pickle=False) as arrays:
        angles = np.radians(arrays[f"angles_{dim}"] / 100)
        _, group = np.unique(arrays[f"structure_{dim}"], return_inverse=True)
    return Grouped(Drawn(angles, "torus"), group)


def backbone(dim: int) -> Grouped:
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
    return Grouped(Drawn(dequantised(np.array(rows)), "torus"), np.array(group))


def known(dim: int) -> Grouped:
    """A hidden Markov chain of rotamers, of which the density is known.

    Each angle has one of `STATES` states, which depend on the state before; in a state it is von Mises
    about a mean that sways with the sine of the angle before. Its density is a sum over all paths.
    """
    rng = np.random.default_rng(dim)
    start = rng.dirichlet(np.full(STATES, 2.0))
    moves = rng.dirichlet(np.full(STATES, 0.7), (dim - 1, STATES))
    means = rng.uniform(-np.pi, np.pi, (dim, STATES))
    sway = rng.uniform(-0.6, 0.6, (dim, STATES))
    kappa = np.exp(rng.uniform(math.log(5), math.log(60), (dim, STATES)))

    state = rng.choice(STATES, KNOWN_ROWS, p=start)
    data = np.empty((KNOWN_ROWS, dim))
    for axis in range(dim):
        if axis:
            edges = moves[axis - 1].cumsum(axis=1)[state]
            state = (rng.uniform(size=(KNOWN_ROWS, 1)) > edges[:, :-1]).sum(axis=1)
        before = np.sin(data[:, axis - 1]) if axis else 0.0
        data[:, axis] = rng.vonmises(
            means[axis, state] + sway[axis, state] * before, kappa[axis, state]
        )

    def log_density(x: Data) -> Data:
        paths = np.log(start)[None]
        for axis in range(dim):
            if axis:
                paths = logsumexp(paths[:, :, None] + np.log(moves[axis - 1]), axis=1)
            before = np.sin(x[:, axis - 1]) if axis else np.zeros(len(x))
            off = x[:, axis, None] - means[axis] - sway[axis] * before[:, None]
            paths = paths + kappa[axis] * (np.cos(off) - 1)
            paths = paths - np.log(2 * math.pi * ive(0, kappa[axis]))
        return np.asarray(logsumexp(paths, axis=1))

    return Grouped(Drawn(data, "torus", log_density))


def rna_angles() -> Grouped:
    """Seven angles of RNA residues."""
    _, group = np.unique(rna_structures(), return_inverse=True)
    return Grouped(Drawn(np.radians(rna()), "torus"), group)


SETS: dict[str, Callable[[], Grouped]] = {
    **{f"sidechains-{d}": lambda d=d: sidechains(d) for d in range(4, 15)},
    **{f"backbone-{d}": lambda d=d: backbone(d) for d in range(4, 15, 2)},
    **{f"known-{d}": lambda d=d: known(d) for d in range(4, 15, 2)},
    "rna-7": rna_angles,
}


@lru_cache(maxsize=2)
def load(name: str) -> Grouped:
    """One of `SETS`."""
    return SETS[name]()
