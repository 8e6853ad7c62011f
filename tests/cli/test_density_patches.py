"""`orbiflow density patches` by the public command, and mistakes."""

from pathlib import Path

import numpy as np

from orbiflow.density.spaces.patches import klein_patch
from refusals import names


def test_patches_to_angles(tmp_path: Path, orbiflow) -> None:
    rng = np.random.default_rng(0)
    wanted = np.stack([rng.uniform(0, 180, 50), rng.uniform(-90, 270, 50)], axis=1)
    pixels = 128 + 40 * klein_patch(*np.radians(wanted.T))
    pixels[0] += 30 * np.array([1, -2, 1, -2, 4, -2, 1, -2, 1])  # far from the surface
    data, out = tmp_path / "patches.npy", tmp_path / "angles.csv"
    np.save(data, pixels)
    options = ("--unit", "degrees", "--farthest", 0.5, "--out", out)
    done = orbiflow("density", "patches", data, *options)
    assert done.status == 0, done.err
    names(done.out, 49, 1)
    header, *rows = out.read_text().splitlines()
    assert header == "theta,phi,distance"
    values = np.array([row.split(",") for row in rows], dtype=float)
    np.testing.assert_allclose(values[:, :2], wanted[1:], atol=1e-6)


def test_mistakes(tmp_path: Path, orbiflow) -> None:
    data, out = tmp_path / "patches.csv", tmp_path / "angles.csv"
    data.write_text("1,2,3,1,2,3,1,2,3\n" + "5,5,5,5,5,5,5,5,5\n")
    for arguments, about in (
        ((data,), "2"),
        ((data, "--columns", "1,2,3"), "9 8 3"),
        ((data, "--farthest", -1), "--farthest 0"),
        ((tmp_path / "nowhere.csv",), "nowhere.csv"),
    ):
        done = orbiflow("density", "patches", *arguments, "--out", out)
        assert done.status == 2
        names(done.err, *about.split())
        assert not out.exists()
    data.write_text("0,0,0,0,1,0,0,0,0\n")
    done = orbiflow("density", "patches", data, "--farthest", 0.1, "--out", out)
    assert done.status == 2
    names(done.err, 1, "0.1")
