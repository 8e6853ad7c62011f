"""result.json: its schema, its metrics, and that what it states tiles the plane."""

import json
import re
import runpy
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest
import shapely

from orbiflow.tiles import ClassFailure, OccupancySearch, SearchResult, Target, report
from outlines import searched

DOCS = Path(__file__).parents[3] / "docs"
SCHEMA = json.loads((DOCS / "result.schema.json").read_text(encoding="utf-8"))
SNIPPET = re.findall(r"```python\n(.*?)```", (DOCS / "result.md").read_text("utf-8"), re.DOTALL)

# pixels far from the origin, so that translations of the group are large beside the tile
BOOT = 40 * np.array([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5], [-0.3, 1.2]])
BOOT += [700, 300]
CLASSES = ["IH6", "IH21", "IH1"]
QUICK = OccupancySearch(
    max_frequency=3, turns=2, finalists=1, iterations=12, affine_iterations=20, points=200, seed=3
)


@pytest.fixture(scope="module", params=[False, True], ids=["y up", "y down"])
def case(request: pytest.FixtureRequest) -> tuple[Target, dict[str, Any]]:
    """A target and its document as read back from JSON."""
    target = Target.from_polygon(BOOT, y_down=request.param)
    results, failures = searched(target, CLASSES, QUICK)
    assert len(results) == 3
    failures = [*failures, ClassFailure("IH2", "the boundary crosses itself")]
    found = SearchResult(target, results, failures, method=QUICK, seconds=12.3456, workers=2)
    document = report(found)
    return target, json.loads(json.dumps(document, allow_nan=False))


def validator() -> jsonschema.Draft202012Validator:
    return jsonschema.Draft202012Validator(SCHEMA)


def test_documents_are_valid(case: tuple[Target, dict[str, Any]]) -> None:
    _, document = case
    validator().validate(document)
    assert document["seed"] == QUICK.seed
    assert document["timings"]["wall_seconds"] == 12.346
    assert [entry["class"] for entry in document["failed"]] == ["IH2"]
    scores = [entry["score"] for entry in document["tiles"]]
    assert scores == sorted(scores, reverse=True)
    assert {entry["class"] for entry in document["tiles"]} == set(CLASSES)


def test_a_document_without_tiles_is_valid() -> None:
    target = Target.from_polygon(BOOT)
    own = replace(QUICK, segments=2)
    document = report(SearchResult(target, failures=[ClassFailure("IH4", "no")], method=own))
    document = json.loads(json.dumps(document))
    validator().validate(document)
    assert document["timings"]["core_seconds"] == 0


@pytest.mark.parametrize(
    ("path", "value"),
    [
        *((["schema_version"], 1), (["seed"], -1), (["tiles", 0, "class"], "IH94")),
        *((["tiles", 0, "polygon", 0], [0.0, 0.0, 0.0]), (["tiles", 0, "metrics", "iou"], 1.5)),
        (["tiles", 0, "certificate", "reasons"], ["it overlaps"]),
        (["tiles", 0, "certificate", "valid"], False),
        *((["tiles", 0, "group", "lattice"], [[1.0, 0.0]]), (["tiles", 0, "unknown"], 1)),
        *((["input", "kind"], "pdf"), (["settings", "max_frequency"], 61)),
    ],
)
def test_the_schema_notices(
    case: tuple[Target, dict[str, Any]], path: list[str | int], value: object
) -> None:
    document = json.loads(json.dumps(case[1]))
    inner: Any = document
    for key in path[:-1]:
        inner = inner[key]
    inner[path[-1]] = value
    assert not validator().is_valid(document)


def test_polygons_lie_on_the_input(case: tuple[Target, dict[str, Any]]) -> None:
    target, document = case
    goal = shapely.Polygon(BOOT)
    assert document["input"]["y_down"] is target.y_down
    assert document["input"]["area"] == pytest.approx(goal.area, rel=1e-12)
    for entry in document["tiles"]:
        assert entry["polygon"][0] == entry["polygon"][-1]
        tile = shapely.Polygon(entry["polygon"])
        assert tile.is_valid
        corners = entry["corners"]
        assert corners == sorted(set(corners))
        assert corners[0] == 0
        assert corners[-1] < len(entry["polygon"]) - 1
        metrics = entry["metrics"]
        assert metrics["iou"] > 0.6
        common = tile.intersection(goal).area
        assert metrics["iou"] == pytest.approx(common / tile.union(goal).area, abs=1e-12)


def test_certificates_are_of_the_stated_polygon(case: tuple[Target, dict[str, Any]]) -> None:
    for entry in case[1]["tiles"]:
        certificate, group = entry["certificate"], entry["group"]
        assert certificate["valid"] is True
        x, y = np.array(entry["polygon"][:-1]).T
        area = 0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)
        assert certificate["signed_area"] == pytest.approx(area, rel=1e-9)
        expected = abs(np.linalg.det(np.array(group["lattice"]))) / len(group["cosets"])
        assert certificate["expected_area"] == pytest.approx(expected, rel=1e-12)
        assert abs(area) == pytest.approx(expected, rel=1e-9)


def test_the_snippet_of_the_manual(
    case: tuple[Target, dict[str, Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    (snippet,) = SNIPPET
    assert "orbiflow" not in snippet
    script, path = tmp_path / "check.py", tmp_path / "result.json"
    script.write_text(snippet, "utf-8")
    monkeypatch.setattr(sys, "argv", ["check.py", str(path)])
    path.write_text(json.dumps(case[1]), "utf-8")
    runpy.run_path(str(script))
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == [
        entry["class"] for entry in case[1]["tiles"]
    ]
    broken = json.loads(json.dumps(case[1]))
    broken["tiles"][2]["group"]["lattice"][0][0] *= 1.01
    path.write_text(json.dumps(broken), "utf-8")
    with pytest.raises(AssertionError):
        runpy.run_path(str(script))
