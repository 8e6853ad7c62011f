"""Modules of the browser run by node: pulls stay in the space and follow."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from scipy.sparse import csr_matrix

from bent_tiles import bent_tile
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.studio.pulled_tiles import pulled, space_json
from orbiflow.tiles import EscherTile
from outlines import bent_squirrel
from studio.test_pulled_tiles import squirrel as mapped_squirrel

CLOSEUP = Path(__file__).parents[2] / "src/orbiflow/studio/static/js/closeup"
PULL = """
import { crosses } from "MODULES/crossing.js";
import { Puller } from "MODULES/pull.js";
const { space, pulls } = JSON.parse((await import("node:fs")).readFileSync(0));
const puller = new Puller(space);
const size = Math.sqrt(puller.area);
const told = [{ polygon: [...puller.polygon()], parameters: puller.parameters() }];
for (const { vertex, reach, by, lattice } of pulls) {
  puller.reset();
  puller.grab(vertex, 0, reach * size, { lattice });
  const from = puller.held();
  const target = [from[0] + by[0] * size, from[1] + by[1] * size];
  let left = 1;
  for (let k = 0; k < 200 && left > 1e-7; k += 1) left = puller.pull(target);
  const ring = puller.polygon();
  told.push({
    polygon: [...ring], parameters: puller.parameters(), held: puller.held(), target, left,
    placement: puller.placement(), body: [...puller.body()], crosses: crosses(ring),
  });
}
console.log(JSON.stringify(told));
"""


FOLLOW = """
import { Puller } from "MODULES/pull.js";
const { space, pulls } = JSON.parse((await import("node:fs")).readFileSync(0));
const puller = new Puller(space);
const size = Math.sqrt(puller.area);
console.log(JSON.stringify(pulls.map(({ share, by }) => {
  puller.reset();
  puller.grab(Math.floor(share * puller.count), 0, 0.5 * size);
  const from = puller.held();
  const goal = [from[0] + by[0] * size, from[1] + by[1] * size];
  let now = { left: 1, stopped: false };
  for (let k = 0; k < 60 && now.left > 2e-5; k += 1) now = puller.follow(goal);
  const there = { polygon: [...puller.polygon()], parameters: puller.parameters() };
  Object.assign(there, { moved: puller.moved(), stopped: now.stopped });
  if (now.stopped) for (let k = 0; k < 45; k += 1) puller.follow(from);
  return { ...there, back: puller.moved() };
})));
"""


def run_in_node(program: str, given: Any) -> Any:
    """Run a module of JavaScript with the close-up's modules; return the JSON that it prints."""
    node = shutil.which("node")
    if node is None:
        why = "neither node nor playwright"
        driver = pytest.importorskip("playwright._impl._driver", reason=why)
        node = driver.compute_driver_executable()[0]
    command = [node, "--input-type=module", "-e", program.replace("MODULES", CLOSEUP.as_uri())]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


NAMES = "IH1", "IH6", "IH21"
CASES = [(name, lattice) for name in NAMES for lattice in (True, False)]


@pytest.fixture(scope="module", name="told")
def told_fixture() -> dict[str, Any]:
    """For some classes what a pull with and one without the lattice gave."""
    found = {}
    for name in NAMES:
        tile = EscherTile(bent_tile(name, 30.0))
        space = space_json(tile)
        pulls = [
            {"vertex": 30, "reach": reach, "by": [0.12, -0.07], "lattice": lattice}
            for lattice in (True, False)
            for reach in (1.2, 0.35)
        ]
        start, *answers = run_in_node(PULL, {"space": space, "pulls": pulls})
        found[name] = {"tile": tile, "space": space, "start": start}
        for asked, answer in zip(pulls, answers, strict=True):
            found[name, asked["lattice"], asked["reach"]] = answer
    return found


def ring_of(answer: dict[str, Any]) -> Array:
    return np.array(answer["polygon"]).reshape(-1, 2)


@pytest.mark.parametrize("name", NAMES)
def test_it_starts_as_the_tile_is(told, name: str) -> None:
    space, start = told[name]["space"], told[name]["start"]
    assert np.abs(ring_of(start) - space["polygon"]).max() < 1e-9
    assert np.abs(np.array(start["parameters"]) - space["start"]).max() < 1e-9


@pytest.mark.parametrize("reach", [1.2, 0.35])
@pytest.mark.parametrize(("name", "lattice"), CASES)
def test_the_outline_is_of_the_space_and_the_server_proves_it(
    told, name: str, lattice: bool, reach: float
) -> None:
    own, answer = told[name], told[name, lattice, reach]
    space, given = own["space"], np.array(answer["parameters"])
    shape = space["rows"], space["cols"]
    matrix = csr_matrix((space["values"], space["indices"], space["indptr"]), shape=shape)
    ring = ring_of(answer)
    assert np.abs((matrix @ given).reshape(-1, 2) - ring).max() < 1e-7
    assert answer["crosses"] is not shapely.Polygon(ring).is_valid
    if answer["crosses"]:
        with pytest.raises(CertificationError, match="crosses itself"):
            pulled(own["tile"], given)
        return
    found = pulled(own["tile"], given)
    assert found.certificate.valid
    # the browser shows the copies where the certified group has them
    moved, first = answer["placement"], own["tile"].tile.group
    linear, shift = np.array(moved["linear"]), np.array(moved["shift"])
    assert np.abs(linear @ first.lattice - found.tile.group.lattice).max() < 1e-7
    same = first.conjugate(linear, shift)
    assert np.abs(same.translations - found.tile.group.translations).max() < 1e-6
    if not lattice:
        assert np.abs(linear - np.eye(2)).max() < 1e-12


@pytest.mark.parametrize(("name", "lattice"), CASES)
def test_it_follows_the_hand_and_what_is_far_stays(told, name: str, lattice: bool) -> None:
    size = np.sqrt(abs(told[name]["tile"].tile.signed_area))
    for reach in (1.2, 0.35):
        answer = told[name, lattice, reach]
        assert answer["left"] < 1e-6  # it has come to rest
        missed = np.linalg.norm(np.subtract(answer["held"], answer["target"])) / size
        assert missed < (0.02 if lattice or reach < 1 else 0.04)
    wide, narrow = (ring_of(told[name, lattice, reach]) for reach in (1.2, 0.35))
    before = np.array(told[name]["space"]["polygon"])
    moves = [np.linalg.norm(ring - before, axis=1) / size for ring in (wide, narrow)]
    assert (moves[1] > 0.02).sum() < (moves[0] > 0.02).sum()


@pytest.fixture(scope="module", name="followed")
def followed_fixture() -> dict[tuple[str, float], Any]:
    """Where random pulls of some lengths, in sizes of the tile, led on some tiles of a search."""
    rng, found = np.random.default_rng(1), {}
    for name in ("IH1", "IH4"):
        tile = EscherTile(bent_tile(name) if name == "IH1" else bent_squirrel(name).tile)
        space = space_json(tile)
        for reach, count in ((0.05, 4), (1.0, 1)):
            turns = rng.uniform(0, 2 * np.pi, count)
            pulls = [
                {"share": rng.random(), "by": [reach * np.cos(turn), reach * np.sin(turn)]}
                for turn in turns
            ]
            answers = run_in_node(FOLLOW, {"space": space, "pulls": pulls})
            found[name, reach] = tile, answers
    return found


@pytest.mark.parametrize("name", ["IH1", "IH4"])
def test_ordinary_pulls_succeed_whole(followed, name: str) -> None:
    _, answers = followed[name, 0.05]
    assert all(shapely.Polygon(ring_of(answer)).is_valid for answer in answers)
    assert sum(not answer["stopped"] for answer in answers) >= 3
    assert min(answer["moved"] for answer in answers if not answer["stopped"]) > 0.03


@pytest.mark.parametrize("name", ["IH1", "IH4"])
def test_a_pull_too_far_stops_at_a_tile_and_can_go_back(followed, name: str) -> None:
    tile, answers = followed[name, 1.0]
    (answer,) = answers
    assert answer["stopped"]
    assert shapely.Polygon(ring_of(answer)).is_valid
    assert answer["back"] < 0.01
    assert answer["moved"] > 0.1
    assert pulled(tile, answer["parameters"]).certificate.valid


def test_what_is_drawn_is_carried_simplified_and_rubbed_out() -> None:
    program = """
import { Carry } from "MODULES/carry.js";
import { rubbed, simplified } from "MODULES/lines.js";
const { map, points, line } = JSON.parse((await import("node:fs")).readFileSync(0));
const carry = new Carry({ map });
const there = points.map((point) => carry.forward(point));
console.log(JSON.stringify({
  there,
  back: there.map((point) => carry.inverse(point)),
  few: simplified(line, 0.01, 100),
  short: simplified(line, 0.01, 0.2),
  parts: rubbed(line, [0.5, 0], 0.1),
  whole: rubbed(line, [0.5, 9], 0.1),
}));
"""
    from orbiflow.tiles import Bending

    grid = np.stack(np.meshgrid(np.arange(4.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
    corner = np.array([k for k in range(11) if k % 4 < 3])
    steps = np.array([[0, 1, 5], [0, 5, 4]])
    triangles = (corner[:, None, None] + steps).reshape(-1, 3)
    images = grid @ [[1.2, 0.3], [-0.4, 0.9]] + 0.1 * np.sin(3 * grid[:, ::-1])
    bending = Bending(grid, images, triangles)
    points = np.random.default_rng(0).uniform(0, 3, (40, 2))
    line = np.stack([np.linspace(0, 1, 41), 0.001 * (np.arange(41) % 2)], axis=1)
    given = {"rest": grid.tolist(), "images": images.tolist(), "triangles": triangles.tolist()}
    told = run_in_node(program, {"map": given, "points": points.tolist(), "line": line.tolist()})
    assert np.abs(np.array(told["there"]) - bending.forward(points)).max() < 1e-9
    assert np.abs(np.array(told["back"]) - points).max() < 1e-9
    assert told["few"] == line[[0, -1]].tolist()
    sides = np.linalg.norm(np.diff(told["short"], axis=0), axis=1)
    assert sides.max() <= 0.2
    assert told["whole"] is None
    left, right = (line[part, 0] for part in told["parts"])
    assert left.max() < 0.4 < 0.6 < right.min()
    assert len(left) + len(right) > 30


INSIDE = """
import { Puller } from "MODULES/pull.js";
const { space, at, by, gives } = JSON.parse((await import("node:fs")).readFileSync(0));
const puller = new Puller(space);
const size = Math.sqrt(puller.area);
puller.grabInside(at, 0.4 * size, { gives });
const from = puller.held();
const goal = [from[0] + by[0] * size, from[1] + by[1] * size];
let now = { left: 1, stopped: false };
for (let k = 0; k < 60 && now.left > 2e-5; k += 1) now = puller.follow(goal);
console.log(JSON.stringify({
  parameters: puller.parameters(), inside: puller.insides(), polygon: [...puller.polygon()],
  from, held: puller.held(), goal, size, stopped: now.stopped,
}));
"""


@pytest.mark.parametrize("gives", [False, True])
def test_the_inside_is_pulled_and_the_server_carries_the_picture_there(gives: bool) -> None:
    tile = mapped_squirrel("IH4")
    space = space_json(tile)
    assert tile.bending is not None
    assert tile.frame is not None
    eye = np.asarray(space["body"]["points"])[len(space["polygon"]) :].mean(axis=0)
    given = {"space": space, "at": eye.tolist(), "by": [0.06, 0.04], "gives": gives}
    told = run_in_node(INSIDE, given)
    moved = np.subtract(told["held"], told["from"])
    assert np.hypot(*moved) > 0.03 * told["size"]
    still = np.abs(np.array(told["polygon"]).reshape(-1, 2) - space["polygon"]).max()
    assert bool(still > 1e-6 * told["size"]) is gives
    found = pulled(tile, told["parameters"], inside=told["inside"])
    assert found.certificate.valid
    assert found.no_map == ""
    before, after = tile.bending, found.bending
    assert after is not None
    assert found.frame is not None
    rest = before.inverse(tile.frame.to_normal(told["from"]))
    there = found.frame.to_input(after.forward(rest))
    assert np.hypot(*(there - told["held"])) < 0.35 * np.hypot(*moved)
    # what is too far is not followed there
    far = run_in_node(INSIDE, {**given, "by": [3.0, 0.0]})
    assert far["stopped"]
    assert pulled(tile, far["parameters"], inside=far["inside"]).certificate.valid
    with pytest.raises(CertificationError, match="folded"):
        pulled(tile, told["parameters"], inside=np.roll(told["inside"], 2).tolist())
    with pytest.raises(OrbiflowError, match="inside"):
        pulled(tile, told["parameters"], inside=told["inside"][:-2])
