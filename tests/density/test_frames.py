"""Data in any container: frames of all libraries, masked arrays, draws of samplers."""

from decimal import Decimal
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import DensityEstimator
from orbiflow.density.data import as_data, runs_of_draws
from orbiflow.density.tables import RowSettings, SpaceSettings, read_rows
from refusals import refused

NAN = float("nan")


def same(found: Any, values: list[list[float]], names: tuple[str, ...] | None) -> None:
    assert found.names == names
    assert found.values.dtype == np.float64
    assert np.array_equal(found.values, values, equal_nan=True)


ARRAYS = {
    "list": [[1, 2], [3, NAN]],
    "none": [[1, 2], [3, None]],
    "object": np.array([[1, 2], [Decimal(3), None]], dtype=object),
    "masked": np.ma.masked_greater([[1, 2], [3, 999]], 900),
    "masked integers": np.ma.masked_equal(np.array([[1, 2], [3, -99]]), -99),
    "tensor": torch.tensor([[1, 2], [3, NAN]], requires_grad=True),
    "float32": np.array([[1, 2], [3, NAN]], dtype=np.float32),
}


@pytest.mark.parametrize("kind", ARRAYS)
def test_arrays(kind: str) -> None:
    same(as_data(ARRAYS[kind]), [[1, 2], [3, NAN]], None)


def test_columns_with_names() -> None:
    rows = np.array([(1, 2.0), (3, NAN)], dtype=[("phi", "i4"), ("psi", "f8")])
    same(as_data(rows), [[1, 2], [3, NAN]], ("phi", "psi"))
    arrow = pytest.importorskip("pyarrow")
    table = arrow.table({"phi": [1, 3], "psi": [2, None]})
    same(as_data(table), [[1, 2], [3, NAN]], ("phi", "psi"))


def test_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    for psi in (
        [2.0, None],
        [2, pandas.NA],
        pandas.array([2, None], dtype="Int64"),
        pandas.array([2, None], dtype="Float64"),
        np.array([2, None], dtype=object),
    ):
        frame = pandas.DataFrame({"phi": [1, 3], "psi": psi}, index=[7, 5])
        same(as_data(frame), [[1, 2], [3, NAN]], ("phi", "psi"))
    assert as_data(pandas.DataFrame([[1, 2]])).names is None
    for wrong, words in (
        (["x", "1.5"], "phi x 1"),
        ([True, False], "numbers Booleans"),
        (pandas.to_datetime(["2020-01-01", "2020-01-02"]), "numbers dates"),
        ([1.0, 2 + 1j], "phi"),
    ):
        with refused(*words.split()):
            as_data(pandas.DataFrame({"phi": wrong}))


def test_polars() -> None:
    polars = pytest.importorskip("polars")
    for psi in ([2.0, None], [2, None], [2.0, NAN]):
        same(
            as_data(polars.DataFrame({"phi": [1, 3], "psi": psi})),
            [[1, 2], [3, NAN]],
            ("phi", "psi"),
        )
    with refused("phi", "x"):
        as_data(polars.DataFrame({"phi": ["x"]}))
    with refused("call", "collect"):
        as_data(polars.DataFrame({"phi": [1]}).lazy())


def test_xarray() -> None:
    xarray = pytest.importorskip("xarray")
    data = xarray.Dataset({"phi": ("n", [1, 3]), "psi": ("n", [2.0, NAN])})
    same(as_data(data), [[1, 2], [3, NAN]], ("phi", "psi"))
    same(as_data(xarray.DataArray([[1, 2], [3, NAN]])), [[1, 2], [3, NAN]], None)
    with refused("Dataset", "n", "m"):
        as_data(xarray.Dataset({"phi": (("n", "m"), [[1, 3]])}))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (np.array([[1j, 2]]), "numpy.angle"),
        (np.array([[1, 2 + 1j]], dtype=object), "1 numpy.angle"),
        (np.array([["1", "2"]]), "numbers 1"), (np.array([[True, False]]), "numbers Booleans"),
        (np.array([["2020-01-01"]], dtype="M8[D]"), "numbers dates"),
        ([[1, 2], [3]], "rows length"), ({"phi": [1, 2]}, "numbers 1"), ("phi", "phi"),
        (None, "array numbers"), (object(), "object"), ([[1, [2]]], "numbers"),
    ],
)  # fmt: skip
def test_what_is_no_number_is_refused(wrong: Any, words: str) -> None:
    with refused(*words.split()):
        as_data(wrong)


xarray = pytest.importorskip("xarray")

CHAINS, DRAWS = 2, 40


def posterior() -> Any:
    """A posterior sample of one angle, and of two in a variable with labels."""
    rng = np.random.default_rng(0)
    twist = rng.vonmises(0, 4, (CHAINS, DRAWS))
    torsion = rng.vonmises([1.0, 2.0], 8, (CHAINS, DRAWS, 2))
    return xarray.Dataset(
        {"twist": (("chain", "draw"), twist), "torsion": (("chain", "draw", "angle"), torsion)},
        coords={"angle": ["phi", "psi"]},
    )


@given(order=st.permutations(["chain", "draw", "angle"]))
def test_rows_are_draws_whatever_the_order_of_dimensions(order: list[str]) -> None:
    data = posterior()
    found = as_data(data.transpose(*order))
    assert found.names == ("twist", "torsion[phi]", "torsion[psi]")
    frame = data["torsion"].to_series().unstack("angle")  # xarray's own rows: chain after chain
    assert np.array_equal(found.values[:, 1:], frame[["phi", "psi"]].to_numpy())
    assert np.array_equal(found.values[:, 0], data["twist"].to_series().to_numpy())


def test_every_container_gives_the_same_rows() -> None:
    data = posterior()
    rows = as_data(data)
    holders = [
        SimpleNamespace(posterior=data),
        data.stack(sample=("chain", "draw")),
    ]  # as ArviZ has
    if hasattr(xarray, "DataTree"):
        holders.append(xarray.DataTree.from_dict({"posterior": data, "prior": data}))
    for holder in holders:
        found = as_data(holder)
        assert found.names == rows.names
        assert np.array_equal(found.values, rows.values)
    alone = as_data(data["torsion"])
    assert alone.names == rows.names[1:] if rows.names else False
    assert np.array_equal(alone.values, rows.values[:, 1:])


def test_entries_without_labels_are_numbered() -> None:
    data = xarray.Dataset({"x": (("draw", "i", "j"), np.arange(12.0).reshape(3, 2, 2))})
    found = as_data(data)
    assert found.names == ("x[0, 0]", "x[0, 1]", "x[1, 0]", "x[1, 1]")
    assert found.values[1].tolist() == [4, 5, 6, 7]


def test_what_is_not_along_draws_is_refused() -> None:
    data = posterior().assign(step=("chain", [0.1, 0.2]))
    with refused("step"):
        as_data(data)


def test_runs_are_of_one_chain() -> None:
    runs = runs_of_draws(posterior())
    assert runs is not None
    chain = np.repeat(np.arange(CHAINS), DRAWS)
    assert all(len(set(chain[runs == run])) == 1 for run in set(runs))
    assert np.array_equal(np.bincount(runs), np.full(20, DRAWS // 10))
    assert runs_of_draws(posterior().isel(draw=slice(19))) is None  # too few to have neighbours
    assert runs_of_draws(np.zeros((40, 2))) is None


def test_a_fit_holds_out_runs_and_finds_columns_by_name() -> None:
    data = posterior()
    names = {"torsion[phi]": "angle", "torsion[psi]": "angle", "twist": "angle"}
    fit = DensityEstimator(columns=names, unit="radians", components="kernels")
    holder: Any = SimpleNamespace(posterior=data)
    fit.fit(holder)
    assert any("whole groups, of which there are 20" in note for note in fit.report_.notes)
    backwards = data[["torsion", "twist"]]
    assert np.array_equal(fit.score_samples(backwards), fit.score_samples(data))
    given_groups = fit.fit(data, groups=np.repeat(np.arange(CHAINS * 2), DRAWS // 2)).report_
    assert any("of which there are 4" in note for note in given_groups.notes)
    alone = DensityEstimator(
        columns=["torsion[phi]=angle:radians", "torsion[psi]=angle:radians"],
        max_frequency=1,
        segments=1,
        components="flow",
        iterations=1,
    )
    assert alone.fit(data["torsion"]).density_ is not None  # which has no choice, so no groups


def test_a_table_of_draws_has_its_angles_alone(tmp_path: Path) -> None:
    table = tmp_path / "draws.csv"
    posterior()[["twist"]].to_dataframe().to_csv(table)
    told: list[Any] = []
    rows = read_rows(
        table, RowSettings(columns=("twist=angle:radians",)), told.append,
        where=SpaceSettings(space="torus"),
    )  # fmt: skip
    assert rows.columns == ("twist",)
