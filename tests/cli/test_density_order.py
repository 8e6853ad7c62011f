"""Latitude before longitude, and no unit where there is none to say."""

from __future__ import annotations

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
    ("header", "space", "asked"),
    [
        ("longitude,latitude", "sphere", ()),
        ("LON_deg,lat_deg", "sphere", ()),
        ("trend,plunge", "projective-plane", ()),
        ("lat,lon", "sphere", ("--columns", "lon,lat")),
    ],
)
def test_longitude_first_is_refused(
    header: str, space: str, asked: tuple[str, ...], tmp_path: Path, orbiflow
) -> None:
    data = places(tmp_path / "places.csv", header)
    found = orbiflow(*FIT, data, "--space", space, *asked, "--out", tmp_path / "m")
    assert found.status == 2
    names = asked[1] if asked else header
    assert f"--columns '{','.join(reversed(names.split(',')))}'" in found.err
    assert not (tmp_path / "m").exists()
    right = ",".join(reversed(names.split(",")))
    found = orbiflow(*FIT, data, "--space", space, "--columns", right, "--out", tmp_path / "m")
    assert found.status == 0, found.err


def test_units_of_places_are_refused(tmp_path: Path, orbiflow) -> None:
    data = places(tmp_path / "places.csv", "lat,lon")
    for unit, wanted in (("radians", 2), ("turns", 2), ("degrees", 0)):
        found = orbiflow(*FIT, data, "--space", "sphere", "--unit", unit, "--out", tmp_path / "m")
        assert found.status == wanted, found.err
        assert not wanted or "latitude and longitude are degrees" in found.err
