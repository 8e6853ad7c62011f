"""Awkward geometries, shared by all tests: shapes that are right but strange, and what is no shape."""

from typing import Any

import numpy as np
import torch

SQUARE = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])

STRANGE: dict[str, Any] = {
    **{"list": SQUARE.tolist(), "tuples": tuple(map(tuple, SQUARE.tolist()))},
    **{"integers": SQUARE.astype(int), "bytes": SQUARE.astype(np.uint8)},
    **{"float32": SQUARE.astype(np.float32), "tensor": torch.tensor(SQUARE)},
    "tensor of integers": torch.tensor(SQUARE.astype(int)),
    "tensor with a gradient": torch.tensor(SQUARE, requires_grad=True),
    **{"clockwise": SQUARE[::-1], "Fortran order": np.asfortranarray(SQUARE)},
    **{"read-only": np.broadcast_to(SQUARE, SQUARE.shape), "tiny": 1e-6 * SQUARE},
    **{"huge": 1e9 * SQUARE, "far away": SQUARE + 1e8, "thin": SQUARE * [50.0, 0.005]},
    "vertex on a side": np.insert(SQUARE, 1, [1.0, 0.0], axis=0),
    "thin spike": np.insert(SQUARE, 1, [[1.0, 0.0], [1.001, -9.0], [1.002, 0.0]], axis=0),
}
"""Simple closed curves, given in every way that arrays can be given."""

USELESS: dict[str, Any] = {
    **{"nothing": None, "empty": [], "a name": "IH4", "a number": 4.0},
    **{"a dictionary": {"x": 0.0}, "an object": object(), "one vertex": SQUARE[:1]},
    **{"two vertices": SQUARE[:2], "three columns": np.zeros((4, 3)), "a vector": np.zeros(6)},
    **{"a stack": SQUARE[None], "ragged": [[0, 0], [1], [1, 1]]},
    "words": [["a", "b"], ["c", "d"], ["e", "f"]],
    **{"digits in words": [["0", "0"], ["1", "0"], ["0", "1"]], "complex": SQUARE * 1j},
    "NaN": np.where(SQUARE == 2.0, np.nan, SQUARE),
    "infinite": np.where(SQUARE == 2.0, np.inf, SQUARE),
    "beyond float": [[0, 0], [10**400, 0], [0, 1]],
}
"""What no function takes for a polygon."""

NOT_SIMPLE: dict[str, Any] = {
    "bow tie": SQUARE[[0, 2, 1, 3]],
    "on a line": [[0, 0], [1, 0], [2, 0], [3, 0]],
    "one point": [[1, 1]] * 5,
    "there and back": [[0, 0], [1, 0], [2, 0], [1, 0]],
    "figure of eight": [[0, 0], [1, 1], [2, 0], [2, 2], [1, 1], [0, 2]],
}
"""Polygons that cross or touch themselves, or enclose nothing."""
