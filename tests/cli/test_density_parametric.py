"""`density fit` of a parametric family: parameters on the screen and in the report."""

import json
from pathlib import Path

import numpy as np

from refusals import names


def test_parameters_are_shown_and_written(tmp_path: Path, orbiflow) -> None:
    table = np.degrees(np.random.default_rng(0).vonmises([0.2, -1.0], 3.0, (80, 2)))
    data, out = tmp_path / "t.csv", tmp_path / "fit"
    np.savetxt(data, table, delimiter=",", header="phi,psi", comments="")
    call = ("density", "fit", data, "--space", "torus", "--unit", "degrees", "--out", out)
    result = orbiflow.done(*call, "--components", "von-mises")
    names(result.out, "concentration_psi", "degrees")
    found = json.loads((out / "report.json").read_text())["report"]["parametric"]
    assert found["family"] == "von-mises"
    assert [one["name"] for one in found["parameters"]][:2] == ["mean_phi", "concentration_phi"]
    assert f"{found['parameters'][1]['value']:.5g}" in result.out
    orbiflow.done("density", "score", data, "--model", out, "--out", tmp_path / "s.csv")
    refused = orbiflow(*call, "--components", "kent")
    assert refused.status != 0
    names(refused.err, "von-mises")
