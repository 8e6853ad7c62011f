"""Orientations through the commands: files of microscopes, symmetries, options that contradict."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation

from orbiflow.density import RotationSpace
from refusals import names


def channel_text(angles: np.ndarray) -> str:
    head = "Channel Text File\nPrj\ttest\nJobMode\tGrid\nEuler angles refer to Sample Coordinate "
    head += "system (CS0)!\tMag\t300\nPhases\t1\n3.6;3.6;3.6\t90;90;90\tCopper\t11\t225\n"
    head += "Phase\tX\tY\tBands\tError\tEuler1\tEuler2\tEuler3\tMAD\tBC\tBS\n"
    rows = (f"1\t0\t0\t8\t0\t{a}\t{b}\t{c}\t0.5\t100\t90\n" for a, b, c in angles.tolist())
    return head + "".join(rows)


def ang(angles: np.ndarray) -> str:
    head = "# TEM_PIXperUM 1.0\n# Phase 1\n# Symmetry 43\n#\n"
    rows = (f" {a} {b} {c} 0.0 0.0 3000.0 0.9 1 20 1.2\n" for a, b, c in angles.tolist())
    return head + "".join(rows)


def test_files_of_microscopes_are_read(tmp_path: Path, orbiflow: Any) -> None:
    turns = Rotation.from_rotvec(np.random.default_rng(0).normal(0, 0.1, (80, 3)))
    space = RotationSpace(form="bunge", unit="degrees")
    angles = space.from_chart(torch.tensor((turns * Rotation.from_euler("x", 1)).as_quat())).round(
        4
    )
    (tmp_path / "a.ctf").write_text(channel_text(angles))
    (tmp_path / "a.ang").write_text(ang(np.radians(angles)))
    means = []
    for name in ("a.ctf", "a.ang"):
        unit = "degrees" if name == "a.ctf" else "radians"
        done = orbiflow(
            "density", "fit", tmp_path / name, "--space", "rotation-space", "--crystal", "m-3m",
            "--specimen", "222", "--unit", unit, "--components", "kernels", "-o", tmp_path / "m",
        )  # fmt: skip
        assert done.status == 0, done.err
        scored = orbiflow(
            "density", "score", tmp_path / name, "-m", tmp_path / "m", "-o", tmp_path / "s.csv"
        )
        means.append(float(scored.out.split("mean log density ")[1].split()[0]))
        assert "took " in done.out
    assert means[0] == pytest.approx(means[1], abs=1e-2)


def test_points_without_an_orientation_are_doubted(tmp_path: Path, orbiflow: Any) -> None:
    angles = np.random.default_rng(0).uniform(1, 80, (60, 3)).round(3)
    angles[:7] = 0
    (tmp_path / "a.ctf").write_text(channel_text(angles))
    how = ("--space", "cubic-orientations", "--components", "kernels", "-o", tmp_path / "m")
    done = orbiflow("density", "fit", tmp_path / "a.ctf", *how, "--unit", "degrees")
    names(done.out, 0, 7)
    assert "WARNING: Phase" not in done.out
    mixed = (tmp_path / "a.ctf").read_text().replace("\n1\t0", "\n2\t0", 5)
    (tmp_path / "b.ctf").write_text(mixed)
    done = orbiflow("density", "fit", tmp_path / "b.ctf", *how, "--unit", "degrees")
    names(done.out, "WARNING: Phase", 55, 5, "--where Phase=1")
    one = orbiflow(
        "density", "fit", tmp_path / "b.ctf", *how, "--unit", "degrees", "--where", "phase=1"
    )
    assert one.status == 0, one.err
    names(one.out, "55 of 60", "phase=1")
    assert "WARNING: Phase" not in one.out
    angles = np.radians(angles)
    angles[:7] = 12.56637
    (tmp_path / "a.ang").write_text(ang(angles))
    done = orbiflow("density", "fit", tmp_path / "a.ang", *how)
    names(done.err, "--missing-codes 12.56637", "--drop-missing")
    codes = ("--missing-codes", "12.56637", "--drop-missing")
    done = orbiflow("density", "fit", tmp_path / "a.ang", *how, *codes)
    assert done.status == 0, done.err


WRONG = {
    ("torus", "--crystal", "432"): "--crystal torus",
    ("cubic-orientations", "--crystal", "622"): "cubic-orientations",
    ("rotation-space", "--crystal", "2/m"): "--crystal 2/m",
    ("rotation-space", "--specimen", "cube"): "--specimen 432",
    ("rotation-space", "--form", "matrix"): "--form matrix 9 3",
}


@pytest.mark.parametrize("options", WRONG)
def test_wrong_options_name_their_cure(
    options: tuple[str, str, str], tmp_path: Path, orbiflow: Any
) -> None:
    (tmp_path / "a.csv").write_text("phi1,Phi,phi2\n" + "10,20,30\n" * 20)
    done = orbiflow(
        "density", "fit", tmp_path / "a.csv", "--unit", "degrees", "--space", *options, "-o",
        tmp_path / "m",
    )  # fmt: skip
    assert done.status == 2
    names(done.err, *WRONG[options].split())


def test_orientations_are_summarised_and_fitted_and_not_drawn(
    tmp_path: Path, orbiflow: Any
) -> None:
    steps = np.random.default_rng(0).normal(0, 0.06, (150, 3))
    turns = Rotation.from_euler("ZXZ", [0, 45, 0], degrees=True) * Rotation.from_rotvec(steps)
    rows = (turns * Rotation.create_group("O")[np.arange(150) % 24]).as_euler("ZXZ", degrees=True)
    np.savetxt(tmp_path / "a.csv", rows, delimiter=",", header="phi1,Phi,phi2", comments="")
    space = ("--space", "rotation-space", "--crystal", "m-3m", "--unit", "degrees")
    told = tmp_path / "summary.json"
    done = orbiflow("density", "summary", tmp_path / "a.csv", *space, "-o", told)
    assert done.status == 0, done.err
    (found,) = json.loads(told.read_text())["orientations"]
    assert found["cone"] < 2
    assert found["spread"] == pytest.approx(5.5, abs=1)
    mean = Rotation.from_euler("ZXZ", found["mean"], degrees=True)
    images = Rotation.from_euler("ZXZ", [0, 45, 0], degrees=True) * Rotation.create_group("O")
    assert np.degrees((images * mean.inv()).magnitude().min()) < 2
    model = tmp_path / "m"
    specimen = ("--specimen", "orthotropic", "--components", "mixture")
    done = orbiflow("density", "fit", tmp_path / "a.csv", *space, *specimen, "-o", model)
    assert done.status == 0, done.err
    done = orbiflow("density", "plot", "-m", model, "-o", tmp_path / "p")
    assert done.status == 2
    names(done.err, "density sample", "MTEX", "orix")
    assert not (tmp_path / "p").exists()


def test_rotations_of_another_form_than_the_model_are_refused(
    tmp_path: Path, orbiflow: Any
) -> None:
    turns = Rotation.from_rotvec(np.random.default_rng(0).normal(0, 0.5, (60, 3)))
    half = turns.as_quat()[:, :3] / turns.as_quat()[:, 3:]
    tables = {"phi1,Phi,phi2": turns.as_euler("ZXZ"), "rodrigues1,rodrigues2,rodrigues3": half}
    for number, (header, values) in enumerate(tables.items()):
        name = tmp_path / f"{number}.csv"
        np.savetxt(name, values, delimiter=",", header=header, comments="")
    how = ("--space", "rotation-space", "--crystal", "222", "--components", "kernels")
    done = orbiflow("density", "fit", tmp_path / "0.csv", *how, "-o", tmp_path / "m")
    assert done.status == 0, done.err
    done = orbiflow(
        "density", "score", tmp_path / "1.csv", "-m", tmp_path / "m", "-o", tmp_path / "s.csv",
        "--columns", "rodrigues1,rodrigues2,rodrigues3",
    )  # fmt: skip
    names(done.err, "Rodrigues", "ZXZ")
    both = ("-d", tmp_path / "0.csv", "-d", tmp_path / "2.csv", "--space", "rotation-space")
    np.savetxt(
        tmp_path / "2.csv",
        turns.inv().as_euler("ZXZ"),
        delimiter=",",
        header="phi1,Phi,phi2",
        comments="",
    )
    symmetry = ("--crystal", "cubic", "--specimen", "222", "-o", tmp_path / "c.json")
    done = orbiflow("density", "compare", *both, *symmetry)
    assert done.status == 0, done.err
    assert (tmp_path / "c.json").exists()
