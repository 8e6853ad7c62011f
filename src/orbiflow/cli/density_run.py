"""What `orbiflow density` does."""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

from orbiflow.cli.console import output
from orbiflow.density import DensityEstimator, SymmetricDensity, density_to_bytes, read_density
from orbiflow.density.fitting.report import FitReport
from orbiflow.density.fitting.report import Progress as Watch
from orbiflow.density.tables import Table, append_column, read_table, to_csv
from orbiflow.errors import OrbiflowError
from orbiflow.files import make_folder, write_atomic

MODEL = "density.safetensors"
WIDTH = {"sphere": None, "projective-plane": None, "klein-bottle": 2, "torus": None}
MOST_SAMPLES = 100_000_000
BLOCK = 65_536


def run_fit(
    data: Path,
    out: Path,
    *,
    space: str,
    columns: str | None,
    unit: str,
    detail: int,
    segments: int,
    kernels: bool,
    seconds: float | None,
    seed: int,
) -> None:
    """Read, fit, check, write, and say what came of it.

    Raises:
        OrbiflowError: for anything that the user can mend.
    """
    begin = time.perf_counter()
    torch.set_num_threads(1)
    table = read_data(data, columns, WIDTH[space])
    estimator = DensityEstimator(
        space,
        unit=unit,
        detail=detail,
        segments=segments,
        kernels=kernels,
        seconds=math.inf if seconds is None else seconds,
        seed=seed,
    )
    folder = make_folder(out)
    with _bar() as watch:
        estimator.fit(table.values, progress=watch)
    report = estimator.report_
    document = {
        "space": {"name": estimator.space_.name, **estimator.space_.settings()},
        "columns": table.columns,
        "settings": {
            "detail": detail,
            "segments": segments,
            "kernels": kernels,
            "seed": seed,
        },
        "log_likelihood": {
            "natural": estimator.score(table.values),
            "uniform": -math.log(estimator.space_.volume),
            "square_train": -report.train_nll,
            "square_validation": -report.validation_nll,
        },
        "report": _plain(report),
        "seconds": time.perf_counter() - begin,
    }
    saved = density_to_bytes(estimator.density_, columns=list(table.columns))
    write_atomic(folder / MODEL, saved)
    write_atomic(folder / "report.json", json.dumps(document, allow_nan=False, indent=1))
    for note in report.notes:
        say(note)
    gain = document["log_likelihood"]["natural"] - document["log_likelihood"]["uniform"]
    say(
        f"{len(table.values)} rows: mean log density {document['log_likelihood']['natural']:.4f} "
        f"nats, {gain:.4f} more than the uniform density; integral "
        f"{'not checked' if report.mass is None else f'{report.mass:.5f}'}"
    )
    say(f"written to {folder} in {document['seconds']:.0f} s")


def run_score(data: Path, model: Path, out: Path, *, columns: str | None, measure: str) -> None:
    """Add log densities to a table."""
    torch.set_num_threads(1)
    density, extra = model_at(model)
    table = read_data(data, columns or same_columns(data, extra), None)
    points = density.space.to_chart(table.values)
    parts = []
    with torch.no_grad(), _bar() as watch:
        for start in range(0, len(points), BLOCK):
            parts.append(density.log_prob(points[start : start + BLOCK], measure=measure))
            watch(min(1.0, (start + BLOCK) / len(points)), "scoring")
    scores = torch.cat(parts).numpy()
    write_atomic(out, append_column(table, data, "log_prob", scores))
    say(f"mean log density {scores.mean():.4f} nats over {len(scores)} rows; written to {out}")


def run_sample(model: Path, out: Path, *, count: int, seed: int) -> None:
    """Draw samples."""
    if not 1 <= count <= MOST_SAMPLES:
        raise OrbiflowError(f"-n must be from 1 to {MOST_SAMPLES}, got {count}")
    torch.set_num_threads(1)
    density, extra = model_at(model)
    generator = torch.Generator().manual_seed(seed)
    data = density.space.from_chart(density.sample((count,), generator))
    names = extra.get("columns", [])
    if len(names) != data.shape[1]:
        names = density.space.columns
    write_atomic(out, to_csv(names, data))
    say(f"{count} samples written to {out}")


def model_at(folder: Path) -> tuple[SymmetricDensity, dict[str, Any]]:
    return read_density(folder / MODEL if folder.is_dir() else folder)


def read_data(data: Path, columns: str | None, width: int | None) -> Table:
    chosen = None if columns is None else [c for c in re.split(r"\s*,\s*", columns.strip()) if c]
    if chosen is not None and not chosen:
        raise OrbiflowError("--columns names no column; give their names or numbers, as in lat,lon")
    table = read_table(data, columns=chosen, width=width if chosen is None else None)
    for note in table.notes:
        say(note)
    return table


def same_columns(data: Path, extra: dict[str, Any]) -> str | None:
    """The columns of the fit, if the file has a header that names them all."""
    names = extra.get("columns")
    if not names:
        return None
    try:
        read_table(data, columns=names, width=None, max_rows=10**9)
    except OrbiflowError:
        return None
    return ",".join(names)


def _plain(report: FitReport) -> dict[str, Any]:
    document = asdict(report)
    for stage in document["stages"]:
        for name in ("train", "validation"):
            stage[name] = [round(v, 6) if np.isfinite(v) else None for v in stage[name]]
    return document


def say(text: str) -> None:
    output.print(f"  {text}", highlight=False, soft_wrap=True)


@contextmanager
def _bar() -> Iterator[Watch]:
    columns = (
        BarColumn(),
        TaskProgressColumn(),
        TimeElapsedColumn(),
        TextColumn("{task.description}"),
    )
    with Progress(*columns, console=output, transient=True) as progress:
        task = progress.add_task("", total=1.0)
        yield lambda share, what: progress.update(task, completed=share, description=what)
