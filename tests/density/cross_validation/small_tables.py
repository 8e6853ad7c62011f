"""Small cross-validations."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np

from orbiflow.runtime import Call, find

QUICK: dict[str, Any] = {
    "space": "torus", "components": ["mixture"], "against": ["chains"], "folds": 3,
}  # fmt: skip


def angles(rows: int, seed: int = 0) -> np.ndarray:
    """Two of them (rows, 2), in radians."""
    return np.random.default_rng(seed).vonmises([0.5, -1.0], 4.0, (rows, 2))


def write_table(path: Path, columns: dict[str, Any]) -> Path:
    """A CSV of columns by name."""
    cells = zip(*columns.values(), strict=True)
    lines = [",".join(map(str, row)) for row in cells]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n")
    return path


def table_of(tmp_path: Path, rows: int = 48, **more: Any) -> Path:
    phi, psi = angles(rows).T.round(4)
    return write_table(tmp_path / "angles.csv", {"phi": phi, "psi": psi, **more})


def call_of(data: Path, **given: Any) -> Call:
    """A cross-validation into the folder `out` beside the table."""
    fixed = {"data": data, "out": data.with_name("out"), "unit": "radians"}
    chosen = {**QUICK, **fixed, **given}
    return find("density cv").call({k: v for k, v in chosen.items() if v is not None})


def lines_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def rows_of(call: Call) -> list[dict[str, str]]:
    return lines_of(call.flat["out"] / "rows.csv")


def report_of(call: Call) -> dict[str, Any]:
    return json.loads((call.flat["out"] / "report.json").read_text())
