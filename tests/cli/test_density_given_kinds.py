"""What columns of files are taken for is what `DensityEstimator` takes them for, and as refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbiflow.density import DensityEstimator

pandas = pytest.importorskip("pandas")
RNG = np.random.default_rng(0)
ROWS = 60
TABLE = pandas.DataFrame(
    {
        "phi": np.degrees(RNG.vonmises(0, 2, ROWS)),
        "hour": RNG.uniform(0, 24, ROWS),
        "elevation": RNG.uniform(0, 900, ROWS).round(1),
        "level": pandas.Categorical(RNG.integers(1, 4, ROWS)),
    }
)


@pytest.fixture(name="fit")
def fit_fixture(orbiflow: Any, tmp_path: Path) -> Any:
    """Fit to a table in a file, and return the report, or the error."""

    def run(table: Any, *options: str, ending: str = "csv") -> Any:
        path = tmp_path / f"table.{ending}"
        table.to_parquet(path) if ending == "parquet" else table.to_csv(path, index=False)
        words = ("density", "fit", path, "--space", "torus", "--unit", "degrees")
        done = orbiflow(*words, "--components", "mixture", *options, "-o", tmp_path / "fit")
        if done.status:
            return done.err
        return json.loads((tmp_path / "fit" / "report.json").read_text())

    return run


def rows_of(report: Any) -> int:
    return report["log_likelihood"]["natural_rows"]


@pytest.mark.filterwarnings("ignore::orbiflow.errors.DataWarning")
def test_files_and_frames_are_read_alike(fit: Any) -> None:
    pytest.importorskip("pyarrow")
    given = "hour,elevation=linear,level=word"
    said = fit(TABLE, "--columns", "phi", "--given", given, ending="parquet")
    estimator = DensityEstimator(columns="phi", unit="degrees", components="mixture")
    model = estimator.fit(TABLE, given=given)
    known = model.conditional_density_.covariates.columns
    declaration = said["report"]["given"]["declaration"]
    assert declaration == model.conditional_density_.covariates.declaration
    assert [str(own.role) for own in known] == ["cycle:24", "linear", "word"]


def test_times_are_refused(fit: Any) -> None:
    pytest.importorskip("pyarrow")
    times = TABLE.assign(when=pandas.date_range("2026-01-01", periods=ROWS, freq="h"))
    error = fit(times, "--columns", "phi", "--given", "when", ending="parquet")
    assert "'when' holds times" in error


@pytest.mark.parametrize(
    "role", [("--columns", "phi,elevation=linear"), ("--given", "elevation=linear")]
)
def test_codes_are_refused_in_all_columns(fit: Any, role: tuple[str, str]) -> None:
    ask = role if role[0] == "--columns" else ("--columns", "phi", *role)
    wrong = TABLE.copy()
    wrong.loc[3, "elevation"] = -9999
    error = fit(wrong, *ask)
    assert "elevation" in error
    assert "--missing-codes" in error
    said = fit(wrong, *ask, "--missing-codes", "-9999", "--drop-missing")
    assert rows_of(said) == ROWS - 1
    wrong.loc[3, "elevation"] = 999.9  # no farther from the others than an elevation may be
    assert rows_of(fit(wrong, *ask)) == ROWS
