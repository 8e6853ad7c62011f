"""Awkward calls of public functions: it works, or an `OrbiflowError` says what to give instead."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch

from awkward import NOT_SIMPLE, SQUARE, STRANGE, USELESS
from orbiflow import tiles
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.symmetry import translation, wallpaper_group
from orbiflow.tiles.flowing.starts import outline_starts, template_starts
from orbiflow.tiles.flowing.tile_model import extract_tile
from refusals import refused

Call = Callable[..., object]

KIND: Any = tiles.CLASSES["IH4"]
PENTAGON: Any = tiles.CLASSES["IH28"]
GROUP = wallpaper_group("p1", 2 * np.eye(2))
TILE = tiles.Tile(SQUARE, GROUP)
BOOT = [[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2.0, 2.8], [0.8, 2.5], [-0.3, 1.2]]
TARGET = tiles.Target.from_polygon(BOOT)
FAST = tiles.OverlapSearch.for_effort("fast", stages=((2, 1),), polish=0)
QUICK = tiles.OccupancySearch(
    max_frequency=1, turns=1, finalists=1, affine_iterations=1, iterations=1, points=30
)
Model: Any = tiles.TileModel
Tile: Any = tiles.Tile
Emphasis: Any = tiles.Emphasis
patch: Any = tiles.patch
MODEL = Model(KIND, 0.0, max_frequency=1)
PAIR = Model(KIND, [0.0, 1.0], max_frequency=1)
OTHER = Model("IH7", 0.0, max_frequency=1)
SOFT = tiles.SoftTarget(TARGET, resolution=32)
FEW = tiles.OverlapSearch(candidates=1, resolutions=(30,), projected=20, measured=5, boundary=60)

polygon_functions: dict[str, Call] = {
    "Tile": lambda ring: tiles.certify(Tile(ring, GROUP)),
    "Target": lambda ring: tiles.Target.from_polygon(ring).normal,
    "iou": lambda ring: tiles.iou(ring, SQUARE),
    "compare": lambda ring: tiles.compare(SQUARE, ring),
    "hausdorff": lambda ring: tiles.hausdorff(ring, SQUARE),
    "Recogniser": lambda ring: tiles.Recogniser(ring)(ring),
    "prepared_region": tiles.prepared_region,
    "Overlap": tiles.Overlap,
    "overlay_picture": lambda ring: tiles.overlay_picture(TILE, ring).png(200),
}
MEASURING = ("Target", "iou", "compare", "hausdorff", "Recogniser")


@pytest.mark.parametrize("name", polygon_functions)
@pytest.mark.parametrize("ring", STRANGE.values(), ids=STRANGE)
def test_strange_polygons_are_taken(name: str, ring: Any) -> None:
    polygon_functions[name](ring)


@pytest.mark.parametrize("name", polygon_functions)
@pytest.mark.parametrize("ring", USELESS.values(), ids=USELESS)
def test_what_is_no_polygon_is_refused(name: str, ring: Any) -> None:
    with refused():
        polygon_functions[name](ring)


@pytest.mark.parametrize("name", MEASURING)
@pytest.mark.parametrize("ring", NOT_SIMPLE.values(), ids=NOT_SIMPLE)
def test_what_encloses_no_region_is_refused(name: str, ring: Any) -> None:
    with pytest.raises(OrbiflowError):
        polygon_functions[name](ring)


@pytest.mark.parametrize("ring", NOT_SIMPLE.values(), ids=NOT_SIMPLE)
def test_a_tile_that_is_none_is_not_certified(ring: Any) -> None:
    assert not tiles.certify(Tile(ring, GROUP)).valid


loss: Any = tiles.occupancy_loss
WORKS: dict[str, Call] = {
    "class for its name": lambda: tiles.isohedral_class(KIND),
    "shape in a list": lambda: PENTAGON.template([0.1, 0]),
    "shape of integers": lambda: PENTAGON.template(torch.tensor([0, 0])),
    "stretch of integers": lambda: KIND.stretch(np.array([1, 0])),
    "model by name": lambda: Model("IH4", torch.zeros(1), max_frequency=1),
    "model by number": lambda: Model(4, 0.3, max_frequency=1),
    "angles in a list": lambda: Model(KIND, [0.0, 1.0], max_frequency=1),
    "mirrored in a list": lambda: Model(KIND, np.zeros(1), mirrored=[True], max_frequency=1),
    "points in an array": lambda: MODEL(np.zeros((1, 3, 2))),
    "points in a list": lambda: MODEL.inverse([[0.0, 0.0], [0.1, 0.2]]),
    "one index": lambda: MODEL.take(0),
    "descent by name": lambda: tiles.fit_descent(TARGET, "IH4", FAST),
    "occupancy by name": lambda: tiles.fit_occupancy(TARGET, "ih4", QUICK),
    "starts of an outline": lambda: outline_starts(TARGET, KIND, FEW),
    "template starts by name": lambda: template_starts("IH4", turns=1, stretch=0.1, vertices=30),
    "loss of arrays": lambda: loss(MODEL, np.zeros((3, 2)), np.zeros(3), 1.0),
    "occupancy of float64": lambda: SOFT.occupancy(torch.zeros(3, 2, dtype=torch.float64), 0.1),
    "window in an array": lambda: patch(TILE, np.array([0, 0, 1, 1])),
    "frame of integers": lambda: TARGET.frame.to_input(torch.tensor([[1, 2]])),
    "mask of 16 bits": lambda: tiles.Target.from_mask(np.pad(np.full((9, 9), 1, "u2"), 2)),
    "plane group with blanks": lambda: wallpaper_group("p 4 m m"),
    "mask in a list": lambda: Emphasis([[1, 0]], (0, 0, 1, 1)),
}


@pytest.mark.parametrize("call", WORKS)
def test_what_is_meant_is_clear(call: str) -> None:
    WORKS[call]()


bow_tie, space, whole = (
    NOT_SIMPLE["bow tie"],
    torch.zeros(1, 3, 3).double(),
    torch.zeros(3, 2).long(),
)
hexagons = template_starts("IH4", turns=1, stretch=0.0, vertices=30)
distance: Any = tiles.signed_distance
REFUSED: list[tuple[Call, Any, tuple[str, ...]]] = [
    (lambda g: Tile(SQUARE, g), "p4", ("CrystallographicGroup", "p4")),
    (lambda g: Tile(SQUARE, g), KIND, ("isohedral_class(name).group()",)),
    (lambda k: Tile(SQUARE, GROUP, k), KIND, ('"IH4"',)),
    (lambda c: Tile(SQUARE, GROUP, "", c), (0, 9), ("0", "3", "9")),
    (lambda c: Tile(SQUARE, GROUP, "", c), (0.5,), ("0.5",)),
    *((tiles.certify, SQUARE, ("Tile", "Tiling")), (tiles.neighbours, SQUARE, ("Tile",))),
    (tiles.colouring, SQUARE, ("Tile",)),
    (lambda t: patch(t, (0, 0, 1, 1)), SQUARE, ("Tile",)),
    (tiles.tiling_picture, SQUARE, ("Tile",)),
    (lambda t: tiles.certify(TILE, tolerance=t), np.nan, ("tolerance", "nan")),
    (lambda t: tiles.certify(TILE, tolerance=t), 0, ("tolerance", "0")),
    (lambda t: tiles.certify(TILE, tolerance=t), "1e-9", ("tolerance", "'1e-9'")),
    (lambda w: patch(TILE, w), "all", ("window", "xmin")),
    (lambda w: patch(TILE, w), None, ("window", "xmin")),
    (lambda w: patch(TILE, w), [[0, 0], [1, 1]], ("window",)),
    (lambda g: tiles.aspects(TILE, [g]), np.eye(2), ("Isometry",)),
    (lambda g: tiles.aspects(TILE, [g]), translation([0.3, 0]), ("element",)),
    (tiles.isohedral_class, None, ("None", "IH1")),
    (tiles.isohedral_class, ["IH4"], ("isohedral", "list")),
    *((PENTAGON.template, [np.nan, 0], ("shape", "parameters")), (PENTAGON.template, "x", ())),
    *((KIND.stretch, 1.0, ("2)", "()")), (lambda k: Model(k, 0.0), "IH94", ("IH94",))),
    (lambda k: Model(k, 0.0), GROUP, ("isohedral",)),
    (lambda a: Model(KIND, a), [np.nan], ("angles",)),
    (lambda a: Model(KIND, a), np.zeros((2, 2)), ("(S,)",)),
    *((lambda a: Model(KIND, a), [], ("S", "1")), (lambda a: Model(KIND, a), "IH4", ("angles",))),
    (lambda a: Model(KIND, a), None, ("angles", "prototiles")),
    (lambda m: Model(KIND, [0.0, 1.0], mirrored=m), [True], ("mirrored", "(2,)")),
    (lambda d: Model(KIND, 0.0, dtype=d), torch.int64, ("int64",)),
    (lambda s: Model(KIND, 0.0, smoothness=s), np.nan, ("smoothness",)),
    (lambda s: Model(KIND, 0.0, segments=s), 0, ("segments",)),
    (lambda p: Model(KIND, prototiles=p), SQUARE, ("Prototiles",)),
    (lambda p: Model("IH7", prototiles=p), hexagons, ("IH7",)),
    (MODEL, torch.zeros(1, 3, 2), ("torch.float32", "torch.float64")),
    *((MODEL.inverse, whole[None], ("torch.int64",)), (MODEL.inverse, space, ())),
    *((MODEL, [[0.0, 0.0, 0.0]], ("points",)), (MODEL.take, [5], ("0", "5"))),
    *((MODEL.take, [], ()), (Model.joined, [], ("none",))),
    (Model.joined, [MODEL, OTHER], ("IH4", "IH7")),
    *((extract_tile, "IH4", ("TileModel", "IH4")), (extract_tile, PAIR, ("2",))),
    *((tiles.as_map, "IH4", ("TileModel",)), (tiles.load_model, 3, ("3",))),
    (lambda t: tiles.fit_descent(t, KIND, FAST), BOOT, ("Target", "7")),
    (lambda s: tiles.fit_descent(TARGET, KIND, s), "fast", ("SearchMethod",)),
    (lambda t: tiles.OccupancySamples(t, 9, seed=0), BOOT, ("Target",)),
    (lambda r: tiles.OverlapSearch(resolutions=r), (35,), ("boundary", "240")),
    (tiles.SoftTarget, BOOT, ("Target",)),
    (lambda r: tiles.SoftTarget(TARGET, resolution=r), 0, ("resolution",)),
    (lambda b: SOFT.occupancy(torch.zeros(1, 2), b), 0.0, ("blur", "0")),
    (lambda p: distance(p, torch.tensor(SQUARE)), SQUARE, ("Tensor",)),
    (lambda p: distance(p, p), whole, ("int64",)),
    *((lambda p: distance(p, p), space, ("points",)), (tiles.Target.read, None, ("None",))),
    *((TARGET.to_input, [1, 2, 3], ("(3,)",)), (TARGET.to_normal, "x", ("points",))),
    (TARGET.frame.to_normal, torch.zeros(3), ("points",)),
    (lambda s: tiles.rank_score(s, 0.5), "a", ("iou",)),
    (lambda s: tiles.rank_score(0.5, s), None, ("recognisability",)),
    (lambda n: tiles.diverse([1, 2], n, lambda *_: 0.0), 1.5, ("count",)),
    (tiles.Overlap(SQUARE).iou, bow_tie, ("polygon",)),
    (lambda m: Emphasis(m, (0, 0, 1, 1)), "x", ()),
    (lambda b: Emphasis(np.eye(2), b), (0, 0, 1), ("(4,)",)),
    (Emphasis(np.eye(2), (-1, -1, 1, 1)).weight, [1, 2, 3], ("points",)),
]


@pytest.mark.parametrize(("call", "argument", "about"), REFUSED)
def test_what_cannot_be_meant_is_refused(call: Call, argument: Any, about: tuple[str, ...]) -> None:
    with refused(*about) as caught:
        call(argument)
    assert not isinstance(caught.value, CertificationError)


NO_WHOLE = ("3", 2.5, None, True, -1, [1], np.nan)
BAD_SETTINGS: dict[type, dict[str, tuple[Any, ...]]] = {
    tiles.OverlapSearch: {
        **dict.fromkeys(("max_frequency", "turns", "finalists", "seed", "candidates"), NO_WHOLE),
        "stages": ((20, 12), (), ((1, 0),), ((1.5, 1),), "x"),
        "resolutions": (60, "60", (7,), (60, "x"), (np.nan,)),
        **{"reach": (0.1, (0.1,), (0.0, 0.1), (np.inf, 1)), "blur": (None, (0.1, -1.0))},
        **{"smoothness": (2.0, (2.0, np.nan)), "momentum": (2.0, np.nan, "x")},
        **{"boundary": (45, 100, 100.0, "240"), "starts": (None, "anywhere")},
    },
    tiles.OccupancySearch: {
        **dict.fromkeys(("max_frequency", "turns", "finalists", "seed", "points"), NO_WHOLE),
        "hardness": (3.0, (0.0, 1.0), "ab"),
        "learning_rate": (0, np.nan, None),
        "method": (None, 4),
        "steps": (0, 1.5),
    },
}


@pytest.mark.parametrize(
    ("kind", "name", "value"),
    [(k, n, v) for k, rows in BAD_SETTINGS.items() for n, values in rows.items() for v in values],
)
def test_settings_that_cannot_be_used(kind: type, name: str, value: Any) -> None:
    with refused(name):
        kind(**{name: value})
