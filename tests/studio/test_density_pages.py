"""Densities in the studio: tables that are uploaded, fits, what pages are shown of them, and files."""

import base64
import csv
import io
import json
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from density.blends import random_kernels
from orbiflow.density import Mixture, Role, Torus, density_to_bytes, read_density
from orbiflow.studio import density_tasks
from orbiflow.studio.density_routes import EXAMPLES, TABLES
from orbiflow.studio.density_tasks import table_view
from studio.served import Client, done, new_project, studio, worked

ROWS = 40
ANGLES = "".join(f"{v:.2f},{40 * np.sin(v):.2f}\n" for v in np.linspace(-170, 170, ROWS))
BENDS = (
    "name,phi,psi\n" + "".join(f"a{k},{row}\n" for k, row in enumerate(ANGLES.split()))
).encode()


def density_project(client: Client) -> str:
    """The address of a new density."""
    made = client.post("/api/projects", json={"kind": "density"}).json()
    return f"/api/projects/{made['id']}"


def uploaded(client: Client, data: bytes, name: str) -> tuple[str, dict[str, Any]]:
    """The address of a density with a table, and the task that read it."""
    own = density_project(client)
    answer = client.put(f"{own}/density/table", params={"name": name}, content=data)
    assert answer.status_code == 200, answer.text
    return own, done(client, answer)


@pytest.fixture(scope="module", name="client")
def client_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(density_tasks, "SURFACE_CELLS", 8)
        patch.setattr(
            "orbiflow.density.pictures.grids.CELLS",
            {**dict.fromkeys(("line", "square", "pair"), 24), "globe": 12},
        )
        with studio(tmp_path_factory.mktemp("densities"), upload=200_000) as served:
            yield served


@pytest.fixture(scope="module", name="fitted")
def fitted_fixture(client: Client) -> str:
    """A density of two angles that is fitted: one for all tests."""
    own, _ = uploaded(client, BENDS, "bends of a chain.csv")
    task = worked(client, own, "density fit", space="torus", columns=["phi", "psi"], unit="degrees")
    assert task["state"] == "done", task["error"]
    return own


def floats(text: str) -> np.ndarray:
    return np.frombuffer(base64.b64decode(text), "<f4").astype(float)


def model_of(client: Client, own: str) -> Any:
    folder = client.studio.store.home(own.rsplit("/", 1)[1])
    (file,) = folder.glob("fits/*/model/density.safetensors")
    return read_density(file)[0]


def test_a_table_is_looked_at(client: Client) -> None:
    own, task = uploaded(client, BENDS, "bends of a chain.csv")
    assert task["result"]["rows"] == ROWS
    table = client.get(f"{own}/density").json()["table"]
    roles = {column["name"]: column["role"] for column in table["columns"]}
    assert roles == {"phi": "angle:degrees", "psi": "angle:degrees"}
    assert len(table["first"]) == density_tasks.FIRST_ROWS
    assert table["guess"]["space"] == "torus"
    assert client.get(own).json()["name"] == "bends of a chain"


HEADS = {
    "lat,lon\n1,2\n3,4\n": ("sphere", ["lat", "lon"]),
    "lon,lat\n2,1\n4,3\n": ("sphere", ["lat", "lon"]),
    "pole lat,pole lon\n1,2\n3,4\n": ("projective-plane", ["pole lat", "pole lon"]),
    "trend,plunge\n300,2\n3,4\n": ("projective-plane", ["plunge", "trend"]),
    "t,x,y,z\n5,1,0,0\n9,0,0.6,-0.8\n": ("sphere", ["x", "y", "z"]),
    "phi,theta,size\n1,0.5,900\n2,3,40\n": ("klein-bottle", ["theta", "phi"]),
    "id,wind\n1,350\n2,10\n3,90\n": (None, []),
    "id,wind_dir\n1,350\n2,10\n3,90\n": ("torus", ["wind_dir"]),
    "a,b\n1,400\n2,800\n": (None, []),
    "time,minutes\n18:30,10\n9:15,300\n": (None, []),
    "hour_hours,b\n18.5,3\n9,8\n": ("torus", ["hour_hours"]),
}  # fmt: skip


def test_the_space_is_guessed(tmp_path: Path) -> None:
    for text, wanted in HEADS.items():
        (tmp_path / "table.csv").write_text(text)
        found = table_view(tmp_path / "table.csv")["guess"]
        assert (found["space"], list(found["columns"])) == wanted


NAMES = ["phi", "lat", "lon", "x", "y", "z", "theta", "id", "pole lon", "speed"]


@given(
    st.lists(st.sampled_from(NAMES), min_size=1, max_size=6, unique=True),
    st.integers(0, 2**32),
    st.sampled_from([0.1, 1, 6, 100, 300, 5000]),
)
def test_a_guess_names_columns_of_the_table(names: list[str], seed: int, scale: float) -> None:
    values = np.random.default_rng(seed).uniform(-scale, scale, (5, len(names)))
    with TemporaryDirectory() as folder:
        path = Path(folder, "table.csv")
        np.savetxt(path, values, delimiter=",", header=",".join(names), comments="")
        view = table_view(path)
    assert [Role.of(column["role"]).kind for column in view["columns"]]
    assert set(view["guess"]["columns"]) <= set(names)
    assert (view["guess"]["space"] is None) == (not view["guess"]["columns"])


def array_bytes(array: np.ndarray, **options: Any) -> bytes:
    out = io.BytesIO()
    np.save(out, array, **options)
    return out.getvalue()


HOSTILE = {
    "objects.npy": array_bytes(np.array([{}], dtype=object), allow_pickle=True),
    **{"binary.csv": b"\0\1\2", "words.csv": b"a,b\nx,y\n", "many.csv": b"phi\n" + b"1\n" * 60},
    "name.csv": b"p" * 300 + b"\n1\n2\n",
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_hostile_tables_are_refused_in_words(client: Client, name: str, monkeypatch) -> None:
    monkeypatch.setattr(density_tasks, "MAX_ROWS", 50)
    own, task = uploaded(client, HOSTILE[name], name)
    assert task["state"] == "failed"
    assert task["error"]
    assert "/" not in task["error"].replace("/ ", "")
    assert "inside orbiflow" not in task["error"]
    assert client.get(f"{own}/density").json()["table"] is None
    fit = worked(client, own, "density fit", space="torus", columns=["1"], unit="degrees")
    assert "not read" in fit["error"]


def test_other_kinds_of_file_are_not_taken_and_a_tile_has_no_density(client: Client) -> None:
    own = density_project(client)
    for name in ("table", "table.csv.exe", "../../etc/passwd"):
        answer = client.put(f"{own}/density/table", params={"name": name}, content=b"1,2\n")
        assert answer.status_code == 422
        assert "CSV" in answer.json()["error"]
    own = new_project(client)
    for answer in (
        client.get(f"{own}/density"),
        client.put(f"{own}/density/table", params={"name": "a.csv"}, content=b"1,2\n"),
        client.post(f"{own}/density/example", json={"name": "backbone"}),
    ):
        assert answer.status_code == 404


def test_examples_are_tables_with_a_space(client: Client) -> None:
    spaces = {"poles": "projective-plane", "patches": "klein-bottle"}
    for name in EXAMPLES:
        view = table_view(TABLES / f"{name}.csv")
        assert view["guess"]["space"] == spaces.get(name, "torus")
        assert view["rows"] == 1500
    own = density_project(client)
    assert client.post(f"{own}/density/example", json={"name": "nothing"}).status_code == 422
    task = done(client, client.post(f"{own}/density/example", json={"name": "sidechain"}))
    assert task["state"] == "done"
    assert client.get(own).json()["name"] == EXAMPLES["sidechain"][0]


def test_a_fit_says_what_it_is(client: Client, fitted: str) -> None:
    fit = client.get(f"{fitted}/density").json()["fit"]
    density, values = model_of(client, fitted), np.loadtxt(io.StringIO(ANGLES), delimiter=",")
    with torch.no_grad():
        mean = density.log_prob(density.space.to_chart(values), measure="natural").mean()
    assert fit["likelihood"]["natural"] == pytest.approx(float(mean), abs=1e-6)
    assert fit["likelihood"]["natural_rows"] == fit["rows"] == fit["shown"] == ROWS
    assert fit["likelihood"]["uniform"] == pytest.approx(-2 * np.log(360))
    shares = [part["share"] for part in fit["components"]]
    assert sum(shares) + fit["weights"]["uniform"] == pytest.approx(1)
    places, wanted = floats(fit["points"]).reshape(-1, 2), values / 360 + 0.5
    np.testing.assert_allclose(np.sort(places, axis=0), np.sort(wanted, axis=0), atol=1e-5)


def test_its_map_holds_the_whole_density_and_its_surface_is_drawn(client, fitted: str) -> None:
    fit = client.get(f"{fitted}/density").json()["fit"]["number"]
    data = client.get(f"{fitted}/density/{fit}/map", params={"axes": "0-1"}).json()
    assert np.exp(floats(data["logs"])).mean() * 360**2 == pytest.approx(1, abs=0.02)
    surface = client.get(f"{fitted}/density/{fit}/surface").json()
    assert len(floats(surface["points"])) == 3 * 81
    assert len(np.frombuffer(base64.b64decode(surface["levels"]), "<u2")) == 81
    script = client.get("/api/scripts/surface.js")
    assert "javascript" in script.headers["content-type"]
    assert "export function showSurface" in script.text


def test_other_maps_are_not_there(client: Client, fitted: str) -> None:
    fit = client.get(f"{fitted}/density").json()["fit"]["number"]
    for axes in ("0-1-2", "..", "0-/etc", "-1", "0-9999999999999999999"):
        assert client.get(f"{fitted}/density/{fit}/map", params={"axes": axes}).status_code == 404
    assert client.get(f"{fitted}/density/{fit + 1}/map").status_code == 422


def test_faults_of_a_fit_are_told(client: Client, fitted: str) -> None:
    task = worked(client, fitted, "density fit", space="sphere", columns=["phi", "psi"])
    assert "latitude" in task["error"]
    wrong_columns = {"columns": ["phi", "nothing"], "unit": "degrees"}
    task = worked(client, fitted, "density fit", space="torus", **wrong_columns)
    assert "nothing" in task["error"]
    assert client.get(f"{fitted}/density").json()["fit"] is not None
    angles = {"space": "torus", "columns": ["phi"]}
    for wrong in ({"columns": []}, {"space": "klein"}, {"out": "/tmp/x"}, {"unit": "miles"}):
        body = {"operation": "density fit", "settings": {**angles, **wrong}}
        assert client.post(f"{fitted}/tasks", json=body).status_code == 422


def taken(client: Client, own: str, what: str, **settings: Any) -> dict[str, bytes]:
    """The files of a take-away."""
    fit = client.get(f"{own}/density").json()["fit"]["number"]
    task = worked(client, own, "density take", fit=fit, what=what, **settings)
    assert task["state"] == "done", task["error"]
    names = [file["name"] for file in task["result"]["files"]]
    answers = {name: client.get(f"/api/takeaways/{task['id']}/files/{name}") for name in names}
    assert all("attachment" in answer.headers["content-disposition"] for answer in answers.values())
    return {name: answer.content for name, answer in answers.items()}


def test_samples_and_the_model_are_taken_away(client: Client, fitted: str, tmp_path: Path) -> None:
    samples = taken(client, fitted, "samples", count=25)["samples.csv"].decode()
    rows = list(csv.reader(io.StringIO(samples)))
    assert rows[0] == ["phi", "psi"]
    assert len(rows) == 26
    model = taken(client, fitted, "model")
    (tmp_path / "density.safetensors").write_bytes(model["density.safetensors"])
    assert read_density(tmp_path / "density.safetensors")[0].space == Torus(2, unit="degrees")
    assert json.loads(model["report.json"])["columns"] == ["phi", "psi"]


WRONG = [
    {"what": "samples", "data": "/etc/passwd"},
    {"what": "everything"},
    {"what": "samples", "count": 10**9},
    {"what": "figures", "count": 5},
]


def test_nothing_else_is_taken_away(client: Client, fitted: str) -> None:
    for settings in WRONG:
        body = {"operation": "density take", "settings": {"fit": 1, **settings}}
        assert client.post(f"{fitted}/tasks", json=body).status_code == 422


def test_another_table_begins_anew(client: Client) -> None:
    own, _ = uploaded(client, BENDS, "one.csv")
    folder = client.studio.store.home(own.rsplit("/", 1)[1])
    (folder / "fits" / "7").mkdir(parents=True)
    (folder / "fits" / "7" / "view.json").write_text("{}")
    table = {"params": {"name": "two.npy"}, "content": array_bytes(np.eye(2))}
    done(client, client.put(f"{own}/density/table", **table))
    assert {path.name for path in folder.iterdir()} == {"table.npy", "table.json"}
    assert client.get(own).json()["name"] == "two"


def test_two_of_many_angles_are_drawn_when_asked_for(client: Client) -> None:
    own = density_project(client)
    folder = client.studio.store.home(own.rsplit("/", 1)[1]) / "fits" / "3"
    (folder / "model").mkdir(parents=True)
    (folder / "view.json").write_text("{}")
    kernels = random_kernels(np.random.default_rng(3), Torus(3, unit="degrees"))
    saved = density_to_bytes(Mixture([kernels], [1.0]))
    (folder / "model" / "density.safetensors").write_bytes(saved)
    assert client.get(f"{own}/density/3/map", params={"axes": "0-2"}).json() is None
    assert client.get(f"{own}/density/3/surface").json() is None
    assert worked(client, own, "density map", fit=3, axes=[0, 2])["state"] == "done"
    data = client.get(f"{own}/density/3/map", params={"axes": "0-2"}).json()
    assert np.exp(floats(data["logs"])).mean() * 360**2 == pytest.approx(1, abs=0.02)
    assert "different angles" in worked(client, own, "density map", fit=3, axes=[2, 2])["error"]
