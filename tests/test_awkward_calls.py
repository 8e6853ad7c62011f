"""Awkward calls of public functions: it works, or an `OrbiflowError` says what to give instead."""

from __future__ import annotations

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
    with pytest.raises(OrbiflowError, match=r".{20}"):
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
    "labels in an array": lambda: tiles.Target.from_mask(np.pad(np.full((30, 20), 7), 9)),
    "labels of 16 bits": lambda: tiles.Target.from_mask(np.pad(np.full((9, 9), 1, "u2"), 2) + 1),
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
REFUSED: list[tuple[Call, Any, str]] = [
    (lambda g: Tile(SQUARE, g), "p4", "the tile's group must be a CrystallographicGroup, got 'p4'"),
    (lambda g: Tile(SQUARE, g), KIND, r"isohedral_class\(name\).group\(\)"),
    (lambda k: Tile(SQUARE, GROUP, k), KIND, 'give its name, "IH4"'),
    (lambda c: Tile(SQUARE, GROUP, "", c), (0, 9), "from 0 to 3, got 9"),
    (lambda c: Tile(SQUARE, GROUP, "", c), (0.5,), "whole number"),
    (tiles.certify, SQUARE, r"the tile must be a Tile or a Tiling, got an array of shape \(4, 2\)"),
    (tiles.neighbours, SQUARE, "must be a Tile"),
    (tiles.colouring, SQUARE, "must be a Tile"),
    (lambda t: patch(t, (0, 0, 1, 1)), SQUARE, "must be a Tile"),
    (tiles.tiling_picture, SQUARE, "must be a Tile"),
    (lambda t: tiles.certify(TILE, tolerance=t), np.nan, "tolerance must be"),
    (lambda t: tiles.certify(TILE, tolerance=t), 0, "must be above 0, got 0"),
    (lambda t: tiles.certify(TILE, tolerance=t), "1e-9", "got '1e-9'"),
    (lambda w: patch(TILE, w), "all", r"a window is \(xmin"),
    (lambda w: patch(TILE, w), None, r"a window is \(xmin"),
    (lambda w: patch(TILE, w), [[0, 0], [1, 1]], "a window is"),
    (lambda g: tiles.aspects(TILE, [g]), np.eye(2), "must be an Isometry"),
    (lambda g: tiles.aspects(TILE, [g]), translation([0.3, 0]), "not an element"),
    (tiles.isohedral_class, None, "unknown isohedral class None; there are IH1"),
    (tiles.isohedral_class, ["IH4"], "unknown isohedral class a list of 1"),
    (PENTAGON.template, [np.nan, 0], "shape parameters.*finite"),
    (PENTAGON.template, "x", "real numbers"),
    (KIND.stretch, 1.0, r"shape \(..., 2\), got .*\(\)"),
    (lambda k: Model(k, 0.0), "IH94", "unknown isohedral class 'IH94'"),
    (lambda k: Model(k, 0.0), GROUP, "unknown isohedral class"),
    (lambda a: Model(KIND, a), [np.nan], "angles.*finite"),
    (lambda a: Model(KIND, a), np.zeros((2, 2)), r"shape \(S,\)"),
    (lambda a: Model(KIND, a), [], "S at least 1"),
    (lambda a: Model(KIND, a), "IH4", "angles must be real numbers"),
    (lambda a: Model(KIND, a), None, "needs angles or prototiles"),
    (lambda m: Model(KIND, [0.0, 1.0], mirrored=m), [True], r"shape \(2,\)"),
    (lambda d: Model(KIND, 0.0, dtype=d), torch.int64, "floating-point type"),
    (lambda s: Model(KIND, 0.0, smoothness=s), np.nan, "smoothness must be"),
    (lambda s: Model(KIND, 0.0, segments=s), 0, "segments must be"),
    (lambda p: Model(KIND, prototiles=p), SQUARE, "must be a Prototiles"),
    (lambda p: Model("IH7", prototiles=p), hexagons, "not of class IH7"),
    (MODEL, torch.zeros(1, 3, 2), "points are torch.float32, the model is torch.float64"),
    (MODEL.inverse, whole[None], "points are torch.int64"),
    (MODEL.inverse, space, r"shape \(S, N, 2"),
    (MODEL, [[0.0, 0.0, 0.0]], r"shape \(..., N, 2\)"),
    (MODEL.take, [5], "from 0 to 0, got 5"),
    (MODEL.take, [], "choose at least one"),
    (Model.joined, [], "got none"),
    (Model.joined, [MODEL, OTHER], r"\['IH4', 'IH7'\]"),
    (extract_tile, "IH4", "the model must be a TileModel, got 'IH4'"),
    (extract_tile, PAIR, "take one candidate first: this model holds 2"),
    (tiles.as_map, "IH4", "must be a TileModel"),
    (tiles.load_model, 3, "the model's file must be a path, got 3"),
    (lambda t: tiles.fit_descent(t, KIND, FAST), BOOT, "must be a Target, got a list of 7"),
    (lambda s: tiles.fit_descent(TARGET, KIND, s), "fast", "must be a SearchMethod"),
    (lambda t: tiles.OccupancySamples(t, 9, seed=0), BOOT, "must be a Target"),
    (lambda r: tiles.OverlapSearch(resolutions=r), (35,), "divide boundary = 240"),
    (tiles.SoftTarget, BOOT, "must be a Target"),
    (lambda r: tiles.SoftTarget(TARGET, resolution=r), 0, "resolution must be"),
    (lambda b: SOFT.occupancy(torch.zeros(1, 2), b), 0.0, "blur must be above 0"),
    (lambda p: distance(p, torch.tensor(SQUARE)), SQUARE, "must be a Tensor"),
    (lambda p: distance(p, p), whole, "floating-point"),
    (lambda p: distance(p, p), space, r"shape \(..., N, 2\)"),
    (tiles.Target.read, None, "must be a path or a binary stream; .*got None"),
    (TARGET.to_input, [1, 2, 3], r"shape \(..., 2\), got an array of shape \(3,\)"),
    (TARGET.to_normal, "x", "points must be real numbers"),
    (TARGET.frame.to_normal, torch.zeros(3), r"shape \(..., 2\)"),
    (lambda s: tiles.rank_score(s, 0.5), "a", "iou must be a number"),
    (lambda s: tiles.rank_score(0.5, s), None, "recognisability must be"),
    (lambda n: tiles.diverse([1, 2], n, lambda *_: 0.0), 1.5, "count must be a whole"),
    (tiles.Overlap(SQUARE).iou, bow_tie, "not a simple polygon"),
    (lambda m: Emphasis(m, (0, 0, 1, 1)), "x", "real numbers"),
    (lambda b: Emphasis(np.eye(2), b), (0, 0, 1), r"shape \(4,\)"),
    (Emphasis(np.eye(2), (-1, -1, 1, 1)).weight, [1, 2, 3], "points"),
]


@pytest.mark.parametrize(("call", "argument", "message"), REFUSED)
def test_what_cannot_be_meant_is_refused(call: Call, argument: Any, message: str) -> None:
    with pytest.raises(OrbiflowError, match=message) as caught:
        call(argument)
    assert not isinstance(caught.value, CertificationError)


NO_WHOLE = ("3", 2.5, None, True, -1, [1], np.nan)
BAD_SETTINGS: dict[type, dict[str, tuple[Any, ...]]] = {
    tiles.OverlapSearch: {
        **dict.fromkeys(("max_frequency", "turns", "finalists", "seed", "candidates"), NO_WHOLE),
        "stages": ((20, 12), (), ((1, 0),), ((1.5, 1),), "x"),
        "resolutions": (60, "60", (7,), (60, "x"), (np.nan,)),
        "reach": (0.1, (0.1,), (0.0, 0.1), (np.inf, 1)),
        "blur": (None, (0.1, -1.0)),
        "smoothness": (2.0, (2.0, np.nan)),
        "momentum": (2.0, np.nan, "x"),
        "boundary": (45, 100.0, "240"),
        "starts": (None, "anywhere"),
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
    with pytest.raises(OrbiflowError, match=name):
        kind(**{name: value})
