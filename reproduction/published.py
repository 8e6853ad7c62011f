"""Data of the exhibits: nine goals, tiles of EST and ARAP, a silhouette, and printed figures."""

import json
from dataclasses import replace
from functools import cache
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from orbiflow.arrays import Array
from orbiflow.tiles import Target

# the paper's table of KL divergences, as printed
KL = {
    "torus": {"4-gaussian": 0.03, "6-gaussian": 0.45, "checkerboard": 0.67},
    "sphere": {"4-gaussian": 0.03, "6-gaussian": 0.47, "checkerboard": 0.56},
}
# the paper's table of symmetry groups, as printed
GROUPS = {
    "IH1": "p1", "IH2": "pg", "IH3": "pg", "IH4": "p2", "IH5": "pgg", "IH6": "pgg", "IH7": "p3",
    "IH21": "p6", "IH28": "p4",
}  # fmt: skip


class Goal(NamedTuple):
    """One of the paper's nine goals.

    - `name`: The name in words.
    - `outline`: The outline (N, 2), y down.
    - `tiles`: Polygons (N, 2) laid on the goal, by "est", "arap" (each method's first) and
      "est_largest", "arap_largest" (the one of its first twenty that overlaps most).
    - `printed`: The paper's table, by "iou" and "pixel_accuracy", then "paper" and "arap".
    """

    name: str
    outline: Array
    tiles: dict[str, Array]
    printed: dict[str, dict[str, float]]

    def target(self) -> Target:
        """Return the goal at its true aspect."""
        return Target.from_polygon(self.outline, y_down=True, source=self.name)

    def squared(self) -> Target:
        """Return the goal as the paper used it: each axis stretched to the side of a square."""
        low, high = self.outline.min(axis=0), self.outline.max(axis=0)
        outline = 200.0 * (self.outline - low) / (high - low)
        return Target.from_polygon(outline, y_down=True, source=self.name)


@cache
def goals() -> dict[str, Goal]:
    """Return the nine goals by name, in the order of the paper's table."""
    rows = json.loads(_data("nine_goals.json").read_text("utf-8"))["goals"]
    keys = ("est", "est_largest", "arap", "arap_largest")
    return {
        name: Goal(
            name,
            np.array(row["outline"]),
            {key: np.array(row[key]["tile"]) for key in keys},
            row["table"],
        )
        for name, row in rows.items()
    }


def animal() -> Target:
    """Return the silhouette of the exhibits on one animal: a turtle, read from a picture."""
    with resources.as_file(_data("turtle.png")) as path:
        target = Target.read(path)
    return replace(target, source="turtle.png")


def _data(name: str) -> Any:
    return resources.files("reproduction").joinpath("data", name)
