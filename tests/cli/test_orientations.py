"""Orientations through the commands: symmetries, options that contradict."""

import json
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from refusals import names


def test_angles_beyond_a_turn_mark_points_without_an_orientation(tmp_path, orbiflow: Any) -> None:
    angles = np.random.default_rng(0).uniform(0.02, 1.4, (60, 3)).round(5)
    angles[:7] = 12.56637
    np.savetxt(tmp_path / "a.csv", angles, delimiter=",", header="phi1,Phi,phi2", comments="")
    how = ("--space", "rotation-space", "--crystal", "432", "--unit", "radians")
    fit = ("density", "fit", tmp_path / "a.csv", *how, "-o", tmp_path / "m")
    fit = (*fit, "--components", "kernels")
    done = orbiflow.refused(*fit)
    names(done.err, "line 2", "--missing-codes 12.56637", "--drop-missing")
    done = orbiflow.done(*fit, "--missing-codes", "12.56637", "--drop-missing")
    names(done.out, "7 rows")


WRONG = {
    ("torus", "--crystal", "432"): "--crystal torus",
    ("rotation-space", "--specimen", "cube"): "--specimen 432",
    ("rotation-space", "--form", "matrix"): "--form matrix 9 3",
}


@pytest.mark.parametrize("options", WRONG)
def test_wrong_options_name_their_cure(options: tuple[str, str, str], tmp_path, orbiflow) -> None:
    (tmp_path / "a.csv").write_text("phi1,Phi,phi2\n" + "10,20,30\n" * 20)
    done = orbiflow.refused(
        "density", "fit", tmp_path / "a.csv", "--unit", "degrees", "--space", *options, "-o",
        tmp_path / "m",
    )  # fmt: skip
    names(done.err, *WRONG[options].split())


def test_orientations_are_summarised_and_fitted_and_not_drawn(tmp_path, orbiflow: Any) -> None:
    steps = np.random.default_rng(0).normal(0, 0.06, (150, 3))
    turns = Rotation.from_euler("ZXZ", [0, 45, 0], degrees=True) * Rotation.from_rotvec(steps)
    rows = (turns * Rotation.create_group("O")[np.arange(150) % 24]).as_euler("ZXZ", degrees=True)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="phi1,Phi,phi2", comments="")
    space = ("--space", "rotation-space", "--crystal", "m-3m", "--unit", "degrees")
    told = tmp_path / "summary.json"
    orbiflow.done("density", "summary", tmp_path / "a.csv", *space, "-o", told)
    (found,) = json.loads(told.read_text())["orientations"]
    assert found["cone"] < 2
    assert found["spread"] == pytest.approx(5.5, abs=1)
    mean = Rotation.from_euler("ZXZ", found["mean"], degrees=True)
    images = Rotation.from_euler("ZXZ", [0, 45, 0], degrees=True) * Rotation.create_group("O")
    assert np.degrees((images * mean.inv()).magnitude().min()) < 2
    model = tmp_path / "m"
    specimen = ("--specimen", "orthotropic", "--components", "mixture")
    orbiflow.done("density", "fit", tmp_path / "a.csv", *space, *specimen, "-o", model)
    done = orbiflow.refused("density", "plot", "-m", model, "-o", tmp_path / "p")
    names(done.err, "density sample", "MTEX", "orix")
    assert not (tmp_path / "p").exists()


def test_rotations_of_another_form_than_the_model_are_refused(tmp_path, orbiflow: Any) -> None:
    turns = Rotation.from_rotvec(np.random.default_rng(0).normal(0, 0.5, (60, 3)))
    half = turns.as_quat()[:, :3] / turns.as_quat()[:, 3:]
    euler, rodrigues = "phi1,Phi,phi2", "rodrigues1,rodrigues2,rodrigues3"
    tables = (euler, turns.as_euler("ZXZ")), (rodrigues, half), (euler, turns.inv().as_euler("ZXZ"))
    for number, (header, values) in enumerate(tables):
        name = tmp_path / f"{number}.csv"
        np.savetxt(name, values, delimiter=",", header=header, comments="")
    how = ("--space", "rotation-space", "--crystal", "222")
    how = (*how, "--components", "kernels", "--unit", "radians")
    orbiflow.done("density", "fit", tmp_path / "0.csv", *how, "-o", tmp_path / "m")
    done = orbiflow(
        "density", "score", tmp_path / "1.csv", "-m", tmp_path / "m", "-o", tmp_path / "s.csv",
        "--columns", rodrigues,
    )  # fmt: skip
    names(done.err, "Rodrigues", "ZXZ")
    both = ("-d", tmp_path / "0.csv", "-d", tmp_path / "2.csv", "--space", "rotation-space")
    symmetry = ("--crystal", "cubic", "--specimen", "222", "-o", tmp_path / "c.json")
    symmetry += ("--unit", "radians")
    orbiflow.done("density", "compare-data", *both, *symmetry)
    assert (tmp_path / "c.json").exists()
