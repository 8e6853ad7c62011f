"""Tables as people have them are read right, told about, or refused by cause."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from orbiflow.density import DensityEstimator, QuotientSpace, read_density
from orbiflow.symmetry import cell_lattice
from refusals import names

RNG = np.random.default_rng(0)
Summary = Callable[..., tuple[Any, dict[str, Any]]]


def text(header: str, values: np.ndarray, mark: str = ",") -> str:
    rows = "".join(mark.join(f"{v:.6g}" for v in row) + "\n" for row in values)
    return header + "\n" + rows


@pytest.fixture(name="summary")
def summary_fixture(tmp_path: Path, orbiflow: Any) -> Summary:
    """Summarise a text as a table: what the command said, and its document."""

    def run(content: str, *options: object) -> tuple[Any, dict[str, Any]]:
        path, out = tmp_path / "table.csv", tmp_path / "summary.json"
        path.write_text(content, encoding="utf-8")
        out.unlink(missing_ok=True)
        done = orbiflow("density", "summary", path, *options, "--out", out)
        return done, json.loads(out.read_text()) if out.exists() else {}

    return run


EAST = np.stack([RNG.normal(-70, 2, 40), RNG.normal(40, 2, 40), RNG.uniform(1, 9, 40)], axis=1)


@pytest.mark.parametrize("mark", [",", ";"])
def test_places_are_found_by_name(mark: str, summary: Summary) -> None:
    header = "pickup_longitude,pickup_latitude,fare".replace(",", mark)
    done, document = summary(text(header, EAST, mark), "--space", "sphere")
    assert done.status == 0, done.err
    assert document["directions"][0]["mean"] == pytest.approx([40, -70], abs=1)
    assert "WARNING" not in done.out


def test_a_place_in_text_is_not_left_out_for_other_numbers(summary: Summary) -> None:
    table = "lat,lon,depth\n48.2 N,16.4 E,3\n47.1 N,15.4 E,4\n"
    done, _ = summary(table, "--space", "sphere")
    assert done.status == 2
    names(done.err, "'lat'", "'48.2 N'")
    minus = "\u2212"
    table = f"lat;lon;depth\n{minus}32,7;{minus}72,1;3\n{minus}33,7;{minus}71,1;4\n"
    done, document = summary(table, "--space", "sphere")
    assert document["directions"][0]["mean"] == pytest.approx([-33.2, -71.6], abs=0.1)


def test_names_that_say_nothing_are_told(summary: Summary) -> None:
    done, _ = summary(text("a,b", EAST[:, :2]), "--space", "sphere")
    names(done.out, "a as latitude", "b as longitude")
    done, _ = summary(text("a,b,c,d", np.hstack([EAST, EAST[:, :1]])), "--space", "sphere")
    assert done.status == 2
    names(done.err, "x,y,z")


def test_codes_among_angles_are_refused_and_named(summary: Summary) -> None:
    values = np.array([*[10.0] * 5, 220, 200, 210, 999, 999, 990])
    content, degrees = text("wdir", values[:, None]), ("--space", "torus", "--unit", "degrees")
    done, _ = summary(content, *degrees)
    assert done.status == 2
    names(done.err, "'wdir'", "990 in 1", "999 in 2", "--missing-codes")
    done, document = summary(content, *degrees, "--missing-codes=999,990", "--drop-missing")
    assert done.status == 0, done.err
    assert document["columns"][0]["rows"] == 8


def test_angles_beyond_a_turn_are_told(summary: Summary) -> None:
    turning = np.cumsum(RNG.uniform(0, 40, 50))[:, None]
    done, _ = summary(text("heading", turning), "--space", "torus", "--unit", "degrees")
    assert done.status == 0, done.err
    assert "beyond a turn" in done.out
    assert "WARNING" not in done.out


def test_what_is_no_angle_is_left_out_and_said(summary: Summary) -> None:
    index = RNG.permutation(900)[:40].astype(float)
    columns = np.column_stack([index, RNG.uniform(-180, 180, (40, 2)), RNG.normal(15, 5, (40, 2))])
    degrees = ("--space", "torus", "--unit", "degrees")
    table = text(",phi,psi,temperature,bond length", columns)
    done, document = summary(table, *degrees)
    assert [column["name"] for column in document["columns"]] == ["phi", "psi"]
    names(done.out, "'temperature'", "'column1'")
    done, _ = summary(table, *degrees, "--columns", "phi,temperature")
    names(done.out, "WARNING: 'temperature'")
    done, _ = summary(text("a,b", columns[:, 1:3]), *degrees)
    names(done.out, "a, b")
    done, _ = summary(text("phi,psi", columns[:, 1:3]), *degrees)
    assert "took a" not in done.out.replace("took line", "")


BINS = text(
    "angle,count", np.column_stack([np.arange(8) * 2 * np.pi / 7, [7, 4, 1, 1, 2, 1, 2, 2]])
)


def test_counts_are_hinted_at_and_counted(summary: Summary) -> None:
    done, _ = summary(BINS, "--space", "torus", "--columns", "angle")
    assert "if 'count' says how many rows are in each, give --counts count" in " ".join(
        done.out.split()
    )
    done, _ = summary(BINS, "--space", "torus", "--weights", "count")
    names(" ".join(done.out.split()), "--counts count")
    done, document = summary(BINS, "--space", "torus", "--counts", "count")
    (column,) = document["columns"]
    assert column["rows"] == 20
    assert column["rayleigh_p"] == pytest.approx(0.0079, abs=1e-4)
    repeated = np.repeat(np.arange(8) * 2 * np.pi / 7, [7, 4, 1, 1, 2, 1, 2, 2])[:, None]
    _, same = summary(text("angle", repeated), "--space", "torus")
    assert same["columns"][0]["mean"] == pytest.approx(column["mean"])
    for wrong in ("1.5", "-1"):
        done, _ = summary(f"angle,n\n1,{wrong}\n2,3\n", "--space", "torus", "--counts", "n")
        assert (
            f"--counts must be whole numbers from 0 on, 20000000 in all at most, got {wrong}"
            in done.err
        )


@pytest.mark.parametrize("header", ["angle,n_residues", "phi,weight_kg", "angle,count"])
def test_uneven_angles_have_no_hint(header: str, summary: Summary) -> None:
    rows = np.column_stack([RNG.uniform(0, 6, 30), RNG.integers(1, 9, 30)])
    name = header.split(",")[0]
    done, _ = summary(text(header, rows), "--space", "torus", "--columns", name)
    assert "--counts" not in done.out


def test_whole_degrees_are_no_row_numbers(summary: Summary) -> None:
    rows = np.column_stack([np.arange(30.0), RNG.integers(1, 9, 30)])
    _, document = summary(text("angle,count", rows), "--space", "torus", "--unit", "degrees")
    assert [column["name"] for column in document["columns"]] == ["angle"]


def test_radians_are_refused_on_the_sphere(summary: Summary) -> None:
    vectors = RNG.normal(size=(100, 3))
    lat = np.arcsin(vectors[:, 2] / np.linalg.norm(vectors, axis=1))
    lon = np.arctan2(vectors[:, 1], vectors[:, 0])
    for header, east in (
        ("lat,lon", lon),
        ("latitude,longitude", lon % (2 * np.pi)),
        ("dec,ra", lon),
    ):
        table = text(header, np.stack([lat, east], axis=1))
        done, _ = summary(table, "--space", "sphere")
        assert done.status == 2
        names(done.err, "radians")
        assert summary(table, "--space", "sphere", "--unit", "degrees")[0].status == 0
    done, _ = summary(text("lat_rad,lon_rad", np.stack([lat, lon], axis=1)), "--space", "sphere")
    names(done.err, "lat_rad", "radians", "degrees")


def fit(orbiflow: Any, data: Path, out: Path, *options: object) -> Any:
    return orbiflow("density", "fit", data, "--components", "mixture", "--out", out, *options)


def test_quaternions_are_read_by_name_or_form(tmp_path: Path, orbiflow: Any) -> None:
    turns = np.hstack([RNG.normal(0, 0.1, (60, 3)), np.ones((60, 1))])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    data, model = tmp_path / "turns.csv", tmp_path / "m"
    means: list[float] = []
    for header, order, *form in (
        ("w,x,y,z", [3, 0, 1, 2]),
        ("qz,q0,qx,qy", [2, 3, 0, 1]),
        ("a,b,c,d", [0, 1, 2, 3], "--form", "quaternion"),
    ):
        data.write_text(text(header, turns[:, order]))
        done = fit(orbiflow, data, model, "--space", "rotation-space", *form)
        assert done.status == 0, done.err
        report = json.loads((model / "report.json").read_text())
        means.append(report["log_likelihood"]["natural"])
        scored = orbiflow("density", "score", data, "-m", model, "-o", tmp_path / "s.csv")
        names(scored.out, f"{means[-1]:.4f}")
    assert means == pytest.approx([means[0]] * 3, abs=1e-3)
    done = fit(orbiflow, data, model, "--space", "rotation-space")
    names(done.err, "a, b, c, d", "--form")


def test_fractions_of_a_cell(tmp_path: Path, orbiflow: Any) -> None:
    cell = (6.0, 8.0, 10.0, 90.0, 105.0, 90.0)
    fractions = RNG.normal(0.5, 0.05, (60, 3))
    lengths = fractions @ cell_lattice(cell).T
    (tmp_path / "f.csv").write_text(text("fract_x,fract_y,fract_z", fractions))
    (tmp_path / "l.csv").write_text(text("x,y,z", lengths))
    group = ("--space", "P 21", "--cell", ",".join(map(str, cell)))
    pytest.importorskip("gemmi")
    done = fit(orbiflow, tmp_path / "f.csv", tmp_path / "m", *group)
    names(done.out, "WARNING", "[0, 1)")
    done = fit(orbiflow, tmp_path / "l.csv", tmp_path / "m", *group)
    assert "WARNING" not in done.out
    one = read_density(tmp_path / "m" / "density.safetensors")[0]
    done = fit(orbiflow, tmp_path / "f.csv", tmp_path / "n", *group, "--fractional")
    assert done.status == 0, done.err
    assert "WARNING" not in done.out
    other = read_density(tmp_path / "n" / "density.safetensors")[0]
    estimators = [DensityEstimator.fitted(density) for density in (one, other)]
    scores = [own.score_samples(x) for own, x in zip(estimators, (lengths, fractions), strict=True)]
    assert scores[1] == pytest.approx(scores[0], abs=0.02)
    assert np.abs(other.space.from_chart(other.space.to_chart(fractions + 2))).max() < 2
    slopes = [
        own.score_gradient(x) for own, x in zip(estimators, (lengths, fractions), strict=True)
    ]
    assert slopes[1] == pytest.approx(
        slopes[0] @ cell_lattice(cell), abs=0.05 * np.abs(slopes[1]).max()
    )
    done = fit(orbiflow, tmp_path / "f.csv", tmp_path / "k", "--space", "P 21", "--fractional")
    names(done.err, "--fractional", "--cell")


def test_fractions_in_the_plane_are_of_the_conventional_cell() -> None:
    for group, cell in (
        ("cm", (4.0, 3.0)),
        ("p3", (5.0, 5.0)),
        ("p4g", (3.0, 3.0)),
        ("p2", (3, 4, 100)),
    ):
        space = QuotientSpace(group, cell=cell, fractional=True)
        moved = space.to_chart([[0.13, 0.21], [1.13, 0.21], [0.13, -1.79]])
        assert space.distance(moved[:1], moved).max() < 1e-9
        assert QuotientSpace(**space.settings()) == space


def test_numbers_of_columns_are_those_of_the_table(tmp_path: Path, orbiflow: Any) -> None:
    rows = np.column_stack([np.arange(60), np.degrees(RNG.vonmises([0, 1, 2], 4, (60, 3)))])
    (tmp_path / "a.csv").write_text("\n".join(",".join(map(str, row)) for row in rows) + "\n")
    columns = ("--columns", "2,3,4", "--unit", "degrees", "--space", "torus")
    assert fit(orbiflow, tmp_path / "a.csv", tmp_path / "m", *columns).status == 0
    conditional = (
        "density",
        "conditional",
        "-m",
        tmp_path / "m",
        "--out",
        tmp_path / "c",
        "--given",
    )
    done = orbiflow(*conditional, "2=-60")
    assert done.status == 0, done.err
    names(done.out, "column2 = -60")
    assert json.loads((tmp_path / "c" / "report.json").read_text())["columns"] == [
        "column3",
        "column4",
    ]
    done = orbiflow(*conditional, "1=-60")
    assert done.status == 2
    names(done.err, "'1'", "column2, column3, column4")


def test_a_number_of_a_named_column_is_told(tmp_path: Path, orbiflow: Any) -> None:
    rows = np.degrees(RNG.vonmises([0, 1, 2, 3], 4, (60, 4)))
    (tmp_path / "a.csv").write_text(text("omega,phi,psi,chi", rows))
    columns = ("--columns", "2,3,4", "--unit", "degrees", "--space", "torus")
    assert fit(orbiflow, tmp_path / "a.csv", tmp_path / "m", *columns).status == 0
    for command in (("conditional", "--given", "2=-60"), ("marginal", "--columns", "2")):
        done = orbiflow("density", *command, "-m", tmp_path / "m", "--out", tmp_path / "c")
        said = "took 2 for psi, number 2 among the model's columns (phi, psi, chi)"
        assert said in " ".join(done.out.split())


def test_a_score_takes_columns_in_the_order_of_the_fit(tmp_path: Path, orbiflow: Any) -> None:
    data, score = tmp_path / "a.csv", ("density", "score", tmp_path / "a.csv", "-m", tmp_path / "m")
    data.write_text(text("phi,psi", np.degrees(RNG.vonmises([0, 1], 4, (60, 2)))))
    assert fit(orbiflow, data, tmp_path / "m", "--space", "torus", "--unit", "degrees").status == 0
    done = orbiflow(*score, "--columns", "psi,phi", "--out", tmp_path / "s.csv")
    assert done.status == 2
    names(done.err, "--columns 'phi,psi'")
    data.write_text(data.read_text() + "999,10\n999,20\n")
    done = orbiflow(*score, "--out", tmp_path / "s.csv")
    assert done.status == 2
    names(done.err, 999, 2)


@pytest.mark.parametrize("header", ["lat,ns,lon,ew", "Latitude,N/S,Longitude,E/W"])
def test_hemispheres_in_columns_of_their_own(header: str, orbiflow, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    path = tmp_path / "places.csv"

    def said(south: str, west: str) -> str:
        rows = [
            f"{33 + rng.random():.3f},{south},{70 + rng.random():.3f},{west}" for _ in range(30)
        ]
        path.write_text("\n".join([header, *rows]) + "\n")
        return orbiflow("density", "summary", path, "--space", "sphere").err

    assert "says which rows are south or west" in said("S", "W")
    assert "south or west" not in said("N", "E")


def test_units_of_cells_are_those_of_the_columns(summary: Summary) -> None:
    torus = ("--space", "torus")
    cells = "".join(f"{v:.3f} deg,{v / 2:.3f} deg\n" for v in RNG.normal(1, 0.5, 30))
    done, document = summary("phi,psi\n" + cells, *torus)
    assert (done.status, document["unit"]) == (0, "degrees")
    done, _ = summary("phi,psi\n" + cells, *torus, "--unit", "radians")
    assert done.status == 2
    names(done.err, "phi, psi", "degrees", "--unit radians")
    done, _ = summary("lat,lon\n" + cells.replace("deg", "rad"), "--space", "sphere")
    names(done.err, "degrees")
    assert summary("lat,lon\n" + cells, "--space", "sphere")[0].status == 0


def test_winds_in_words_are_summarised(summary: Summary) -> None:
    done, document = summary("wind\n" + "NE\nENE\nE\n" * 9, "--space", "torus")
    assert done.status == 0, done.err
    assert document["columns"][0]["mean"] == pytest.approx(67.5)
    names(done.out, "degrees")


def test_headers_in_comments_are_read(summary: Summary) -> None:
    rows = text("# lon lat", EAST[:, :2], " ")
    done, document = summary(rows, "--space", "sphere")
    assert document["directions"][0]["mean"][0] == pytest.approx(40, abs=1)
    done, _ = summary(text("", EAST[:, [1, 0]]), "--space", "sphere")
    names(done.out, "column1 as latitude", "column2 as longitude")


@pytest.mark.parametrize(("size", "is_serious"), [(100.0, False), (3.0, True)])
def test_columns_beside_those_whose_cells_have_a_unit(
    size: float, is_serious: bool, summary: Summary
) -> None:
    rows = "".join(f"{v:.1f}°,{v / 180 * size:.3f}\n" for v in RNG.uniform(-180, 180, 30))
    done, _ = summary("phi,psi\n" + rows, "--space", "torus")
    names(done.out, "psi", "degrees")
    assert ("WARNING" in done.out) == is_serious


def test_a_space_group_is_asked_for_its_origin(tmp_path: Path, orbiflow: Any) -> None:
    np.savetxt(tmp_path / "a.csv", RNG.random((40, 3)), delimiter=",", header="x,y,z", comments="")
    asked = fit(orbiflow, tmp_path / "a.csv", tmp_path / "m", "--space", "85")
    assert asked.status != 0
    words = re.findall("'(85:.)'", asked.err)
    assert len(words) == 2
    for word in words:
        done = fit(orbiflow, tmp_path / "a.csv", tmp_path / word[-1], "--space", word)
        assert done.status == 0, done.err
        assert f"P 4/n{word[2:]}" in done.out + done.err
