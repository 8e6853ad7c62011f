"""Tiles that are bent far: the straight way to their template may cross itself."""

import numpy as np
from hypothesis import strategies as st

from orbiflow.symmetry import rotation_matrix
from orbiflow.tiles import CLASSES, Tile, certify, isohedral_class


def swirled_tile(name: str, seed: int, strength: float, *, per_edge: int = 24) -> Tile:
    """A tile of a class that a flow which commutes with its group has carried away.

    Args:
        name: of the class.
        seed: of the field.
        strength: how long it flows.
        per_edge: sides along each edge.
    """
    kind = isohedral_class(name)
    group, vertices = kind.group(), kind.template()
    share = np.linspace(0, 1, per_edge, endpoint=False)[:, None]
    edges = zip(vertices, np.roll(vertices, -1, axis=0), strict=True)
    points = np.concatenate([a + share * (b - a) for a, b in edges])
    random = np.random.default_rng(seed)
    waves = random.integers(-2, 3, (6, 2))
    heights, phases = random.normal(size=(6, 2)), random.uniform(0, 2 * np.pi, 6)

    def field(p):
        angle = 2 * np.pi * p @ group.inverse_lattice.T @ waves.T + phases
        return np.sin(angle) @ heights

    size = np.sqrt(group.cell_volume / group.order)
    for _ in range(60):
        velocity = np.mean([field(g(points)) @ g.linear for g in group.cosets], axis=0)
        points = points + strength / 60 * size * velocity
    corners = tuple(range(0, len(points), per_edge))
    tile = Tile(points, group, name, corners)
    linear = 3.0 * rotation_matrix(seed) @ kind.stretch(np.full(kind.stretch_dim, 0.15))
    return tile.transformed(linear * (1.0, -1.0 if seed % 2 else 1.0), np.array([5.0, -2.0]))


def is_sound(tile: Tile) -> bool:
    """Whether it tiles, and has no sides so short that the flow has run into a sink."""
    sides = np.linalg.norm(tile.polygon - np.roll(tile.polygon, 1, axis=0), axis=1)
    return sides.min() > 1e-3 * abs(tile.signed_area) ** 0.5 and certify(tile).valid


swirled = st.builds(
    swirled_tile,
    st.sampled_from([*CLASSES, "IH8", "IH12", "IH13", "IH16", "IH26"]),
    st.integers(0, 999),
    st.floats(0.0, 0.5),
)
