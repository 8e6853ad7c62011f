"""Latitude before longitude, and no unit where there is none to say."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

FIT = ("density", "fit", "--components", "mixture")


def places(path: Path, header: str) -> Path:
    rng = np.random.default_rng(0)
    table = np.stack([rng.normal(48, 3, 40), rng.normal(10, 3, 40)], axis=1)
    np.savetxt(path, table, delimiter=",", header=header, comments="")
    return path


@pytest.mark.parametrize(
    ("header", "space"),
    [
        ("longitude,latitude", "sphere"),
        ("LON_deg,lat_deg", "sphere"),
        ("trend,plunge", "projective-plane"),
    ],
)
def test_longitude_first_is_put_right_and_said(
    header: str, space: str, tmp_path: Path, orbiflow
) -> None:
    data, right = places(tmp_path / "places.csv", header), ", ".join(reversed(header.split(",")))
    found = orbiflow(*FIT, data, "--space", space, "--out", tmp_path / "m")
    assert found.status == 0, found.err
    assert f"took {right} as " in found.out
    report = json.loads((tmp_path / "m" / "report.json").read_text())
    assert report["columns"] == right.split(", ")


def test_longitude_first_is_refused_where_it_was_asked_for(tmp_path: Path, orbiflow) -> None:
    data = places(tmp_path / "places.csv", "lat,lon")
    fit = (*FIT, data, "--space", "sphere", "--out", tmp_path / "m")
    found = orbiflow(*fit, "--columns", "lon,lat")
    assert found.status == 2
    assert "give --columns 'lat,lon'" in found.err
    assert not (tmp_path / "m").exists()
    assert orbiflow(*fit, "--columns", "lat,lon").status == 0


def test_units_of_places_are_refused(tmp_path: Path, orbiflow) -> None:
    data = places(tmp_path / "places.csv", "lat,lon")
    for unit, wanted in (("radians", 2), ("turns", 2), ("degrees", 0)):
        found = orbiflow(*FIT, data, "--space", "sphere", "--unit", unit, "--out", tmp_path / "m")
        assert found.status == wanted, found.err
        assert not wanted or "latitude and longitude are degrees" in found.err
