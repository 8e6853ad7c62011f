"""Draws of samplers in xarray's and ArviZ's containers: the same rows, by chains and draws."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.density import DensityEstimator
from orbiflow.density.data import as_data, runs_of_draws
from orbiflow.density.tables import RowSettings, SpaceSettings, read_rows
from refusals import refused

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
