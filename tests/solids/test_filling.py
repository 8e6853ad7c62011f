"""The whole way from a mesh to solids that fill space, their folder and what is made of them."""

import json
import multiprocessing
import shutil
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from PIL import Image

from orbiflow.drawing import read_triangles
from orbiflow.errors import (
    CertificationError,
    GroupError,
    InputFileError,
    OutputError,
    SettingError,
)
from orbiflow.loading import load
from orbiflow.runtime import Cancel, Cancelled, Event, Note, Progress, team
from orbiflow.solids import (
    BuildSettings,
    EscherSolid,
    FillSettings,
    Mesh,
    as_solid,
    fill,
    read_run,
    read_solid,
    search,
    write_run,
)
from orbiflow.solids.assembly import greatest_overlap
from orbiflow.solids.bodies import as_body, united
from orbiflow.solids.operations import build
from orbiflow.solids.operations import fill as fill_operation
from orbiflow.solids.run_folder import INDEX, OVERVIEW, SOLID_FILES, SOLIDS, folder_name
from orbiflow.solids.search import SolidGoal, usual_size
from orbiflow.solids.separable import pieces_with_gap
from orbiflow.solids.solid import SOLID
from refusals import refused
from solids.known_solids import creature
from solids.small_fills import SMALL, creature_file, found, small_fills, told

SCHEMA = json.loads((Path(__file__).parents[2] / "docs" / "solids.schema.json").read_text())


@pytest.fixture(scope="module", name="run")
def run_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small run of the command, whose search is that of `found`."""
    folder, solids = tmp_path_factory.mktemp("fill"), list(found())
    with small_fills(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(search, "fill", lambda *_, **__: solids)
        outcome = fill_operation(creature_file(folder), folder / "out", SMALL)
    assert outcome.state == "done"
    return folder / "out"


def test_solids_are_certified_and_come_best_first() -> None:
    solids = found()
    assert len(solids) == 2
    assert [own.likeness.score for own in solids] == sorted(
        (own.likeness.score for own in solids), reverse=True
    )
    for own in solids:
        assert own.certificate.is_ball
        assert own.tile.volume == pytest.approx(1, rel=1e-9)
        assert own.group.cell_volume == pytest.approx(own.group.order, rel=1e-9)
        assert own.likeness.shadows > 0.75
        assert own.likeness.overlap > 0.65
        assert np.ptp(own.target.points, axis=0).max() > 0
        np.testing.assert_allclose(own.upright.T @ own.upright, np.eye(3), atol=1e-9)


@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_the_same_seed_gives_the_same_solids_in_any_number_of_processes(monkeypatch) -> None:
    # after a test that has left a thread, workers would come from a server and not know what is small
    monkeypatch.setattr(team, "process_context", lambda _: multiprocessing.get_context("fork"))
    with small_fills():
        again = fill(creature(), SMALL.replace(workers=2), name="creature")
    for one, two in zip(again, found(), strict=True):
        np.testing.assert_array_equal(one.tile.points, two.tile.points)


def test_a_folder_is_read_again(run: Path) -> None:
    document = json.loads((run / SOLIDS).read_text())
    solids = read_run(run)
    assert [entry["group"] for entry in document["solids"]] == [own.group_name for own in solids]
    for rank, own in enumerate(solids, 1):
        folder = run / folder_name(rank, own)
        assert {path.name for path in folder.iterdir()} == set(SOLID_FILES)
        assert own.certificate.valid
        (part,) = read_triangles(folder / "tile.stl")
        sides = np.ptp(part, axis=(0, 1))
        np.testing.assert_allclose(sides, own.size, rtol=1e-5)
        assert np.ptp(own.target.points, axis=0).max() * own.millimetres < 80
        with Image.open(folder / "sheet.png") as sheet, Image.open(folder / "stack.gif") as film:
            assert sheet.size == (320, 140)
            assert getattr(film, "n_frames", 1) == 2
    assert "<canvas" in (run / INDEX).read_text()
    best = run / folder_name(1, solids[0])
    assert (run / OVERVIEW).read_bytes() == (best / "sheet.png").read_bytes()
    assert as_solid(run, "2").group_name == solids[1].group_name
    assert as_solid(run, solids[1].group_name.replace(" ", "")).group_name == solids[1].group_name
    assert as_solid(best).group_name == solids[0].group_name
    loaded = load(run)
    assert isinstance(loaded, list)
    assert [own.group_name for own in loaded] == [own.group_name for own in solids]
    one = load(run / folder_name(2, solids[1]))
    assert isinstance(one, EscherSolid)
    assert one.group_name == solids[1].group_name
    with refused("P4", "ranks 1 to 2"):
        as_solid(run, "P4")


def test_the_document_is_valid_and_says_whether_solids_leave(run: Path) -> None:
    document = json.loads((run / SOLIDS).read_text())
    jsonschema.Draft202012Validator(SCHEMA).validate(document)
    assert document["stopped"] is False
    for entry, own in zip(document["solids"], read_run(run), strict=True):
        assert (entry["leaves"], entry["blocked"]) == (own.leaving.is_free, own.leaving.blocked)
    # independently: a copy with the gap of a print is drawn out of those below it
    center, direction = own.tile.centroid, np.array(entry["leaves_along"])
    piece = pieces_with_gap(own.group, own.tile).piece
    lower = [
        as_body(piece.moved(g.linear, g.translation))
        for g in own.group.elements_near(center, 2.5, source=center)[1:]
        if (g(center) - center) @ direction < 1e-6
    ]
    shared = greatest_overlap(as_body(piece), united(lower), direction, distance=4)
    assert (shared < 1e-4) == entry["leaves"]


def test_what_was_found_is_kept_where_a_search_is_stopped(run, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(search, "_solid", lambda *_: found()[1])
    out, cancel, notes = tmp_path / "out", Cancel(), list[str]()
    shutil.copytree(run, out)  # an earlier run, which is replaced

    def listen(event: Event) -> None:
        if isinstance(event, Progress) and event.what == "closing" and event.share > 0.6:
            cancel.cancel()
        elif isinstance(event, Note):
            notes.append(event.text)

    with small_fills():
        outcome = fill_operation(
            creature_file(tmp_path), out, SMALL, on_event=listen, cancel=cancel
        )
    assert outcome.state == "cancelled"
    document = json.loads((out / SOLIDS).read_text())
    jsonschema.Draft202012Validator(SCHEMA).validate(document)
    assert document["stopped"] is True
    (own,) = read_run(out)
    assert own.group_name == found()[1].group_name
    assert own.certificate.valid
    said = "The search was stopped."
    assert f"{said} Solids that were found by then: 1." in notes
    home = out / folder_name(1, own)
    assert said in (out / INDEX).read_text()
    assert said not in (home / "page.html").read_text()
    with Image.open(out / OVERVIEW) as one, Image.open(home / "sheet.png") as two:
        differing = np.flatnonzero((np.asarray(one) != np.asarray(two)).any(axis=(1, 2)))
    assert differing.min() > 0.9 * 140  # words below the stack, and no more


def test_what_to_do_is_said_where_no_body_closes(run: Path, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(search, "_solid", lambda *_: None)
    out, notes = tmp_path / "out", list[str]()
    shutil.copytree(run, out)
    with small_fills():
        outcome = fill_operation(
            creature_file(tmp_path),
            out,
            SMALL.replace(groups=("P21",)),
            on_event=lambda e: notes.append(e.text) if isinstance(e, Note) else None,
        )
    assert outcome.state == "nothing found"
    assert notes == [
        "no solid was found that is one piece and fills space: copies grip one another's thin parts, "
        "or cut them off; try effort 'normal', which tries more places, or another seed, or no groups, "
        f"or make thin parts thicker; {out} still holds the solids of an earlier run"
    ]
    assert len(read_run(out)) == 2


def test_a_solid_is_saved_bit_for_bit(tmp_path: Path) -> None:
    own = found()[0]
    (tmp_path / SOLID).write_bytes(own.to_bytes())
    again = read_solid(tmp_path)
    np.testing.assert_array_equal(again.tile.points, own.tile.points)
    np.testing.assert_array_equal(again.group.lattice, own.group.lattice)
    for name in ("likeness", "millimetres", "name"):
        assert getattr(again, name) == getattr(own, name)
    damaged = bytearray((tmp_path / SOLID).read_bytes())
    damaged[-100] ^= 1
    (tmp_path / SOLID).write_bytes(damaged)
    with refused("solid.safetensors", kind=InputFileError):
        read_solid(tmp_path)


def test_things_are_made_of_it(run: Path, tmp_path: Path) -> None:
    notes, out = list[str](), tmp_path / "made.3mf"
    settings = BuildSettings(kind="puzzle", size=50, copies=3)
    outcome = build(
        run, out, settings, on_event=lambda e: notes.append(e.text) if isinstance(e, Note) else None
    )
    assert outcome.summary["parts"] == 4
    assert notes
    parts = read_triangles(out)
    assert all(len(part) > 100 for part in parts)
    assert min(part[..., 2].min() for part in parts) == pytest.approx(0, abs=1e-3)


def test_what_does_not_fill_space_is_not_built(tmp_path: Path) -> None:
    own = found()[0]
    points = own.tile.points.copy()
    points[0] += 1e-3
    broken = replace(own, tile=Mesh(points, own.tile.faces))
    with refused("P 1 21 1", kind=CertificationError):
        build(broken, tmp_path / "x.stl")
    assert not (tmp_path / "x.stl").exists()


def test_mistakes_are_named(tmp_path: Path) -> None:
    with refused("Pm", kind=GroupError):
        fill(creature(), SMALL.replace(groups=("Pm",)))
    with refused("nonsense", kind=GroupError):
        fill(creature(), SMALL.replace(groups=("nonsense",)))
    with refused("mesh"):
        fill(creature().of_faces(np.arange(50)), SMALL)
    with refused("copies", kind=SettingError):
        BuildSettings(kind="tile", copies=3)
    (tmp_path / "mine.txt").write_text("mine")
    with refused("mine.txt", kind=OutputError):
        write_run(found(), tmp_path)
    with refused("solids.json", kind=InputFileError):
        read_run(tmp_path)


def test_it_tells_how_far_it_is_and_stops() -> None:
    shares = [event.share for event in told() if isinstance(event, Progress)]
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(0.9)  # pictures are the rest
    cancel = Cancel()
    cancel.cancel()
    with pytest.raises(Cancelled), small_fills():
        fill(creature(), SMALL, cancel=cancel)
    # sizes that nobody prints become usual
    assert usual_size(creature()) == 60
    assert usual_size(creature().moved(50 * np.eye(3))) is None
    goal = SolidGoal.of(creature(), FillSettings())
    assert np.ptp(goal.mesh.points, axis=0).max() * goal.millimetres == pytest.approx(60)
