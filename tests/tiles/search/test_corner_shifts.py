"""Corners that move along the outline to where they best lie."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.runtime import Cancel, Cancelled
from orbiflow.tiles import CLASSES, complex_points, plane_points, resampled, signed_area
from orbiflow.tiles.likeness import Elastic
from orbiflow.tiles.search import Placements, TileSpace, best_placements, co_deformation
from orbiflow.tiles.search.co_deformation import _moves, shifted
from outlines import animal
from strategies import seeds

RING = resampled(animal("squirrel.dat").normal, 60)
BODY = Elastic(RING)


def at_rest(body: Elastic, count: int) -> np.ndarray:
    return np.repeat(body.rest[:, None], count, axis=1)


def a_tile(name: str) -> tuple[Elastic, Placements]:
    """A body whose outline is a tile, and its placement."""
    kind = CLASSES[name]
    space = TileSpace(kind, best_placements(kind, complex_points(RING), 40))
    found = space.nearest(np.tile(complex_points(RING), (40, 1)))
    rings = plane_points(space.in_order(found.vertices))
    sound = shapely.is_valid(shapely.polygons(rings)) & (signed_area(rings) > 0.3)
    sound &= (space.placements.lengths >= 3).all(axis=1) & (np.linalg.det(found.linear) > 1e-3)
    chosen = np.flatnonzero(sound)[:1]
    ring = rings[chosen[0]] / np.sqrt(signed_area(rings[chosen[0]]))
    return Elastic(ring), space.placements._replace(turns=space.turns).take(chosen)


@pytest.mark.parametrize("name", CLASSES)
@given(step=st.integers(1, 4))
def test_moves_keep_to_the_class(name: str, step: int) -> None:
    kind = CLASSES[name]
    lengths, starts = _moves(kind, step)
    assert (lengths.sum(axis=1) == 0).all()
    for pair in kind.identified_edges:
        assert (lengths[:, pair.first] == lengths[:, pair.second]).all()
    both = np.column_stack([lengths, starts])
    assert len(np.unique(both, axis=0)) == len(both)
    assert {(-step,), (step,)} <= {
        (int(s),) for s, change in zip(starts, lengths, strict=True) if not change.any()
    }


@pytest.mark.parametrize("name", CLASSES)
@settings(max_examples=3)
@given(seed=seeds)
def test_corners_find_back_to_a_tile(name: str, seed: int) -> None:
    """An outline that is a tile: from corners moved by a step they return."""
    body, own = a_tile(name)
    lengths, starts = _moves(CLASSES[name], 1)
    back = {
        (*change, start)
        for change, start in zip((-lengths).tolist(), (-starts).tolist(), strict=True)
    }
    ways = [k for k, change in enumerate(lengths.tolist()) if (*change, int(starts[k])) in back]
    way = ways[seed % len(ways)]
    away = own._replace(
        lengths=own.lengths + lengths[way], starts=(own.starts + starts[way]) % body.size
    )
    found = shifted(body, CLASSES[name], away, at_rest(body, 1), 1, share=1.0)
    assert (found.placements.lengths == own.lengths).all()
    assert found.placements.starts == own.starts


@pytest.mark.parametrize("share", [0.2, 1.0])
@pytest.mark.parametrize("name", ["IH1", "IH4", "IH5", "IH21"])
def test_no_placement_becomes_worse(name: str, share: float) -> None:
    kind = CLASSES[name]
    placements = best_placements(kind, complex_points(RING), 12)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(co_deformation, "MAX_MOVES", 0)
        stay = shifted(BODY, kind, placements, at_rest(BODY, 12), 1, share=share)
    gone = shifted(BODY, kind, placements, at_rest(BODY, 12), 2, share=share)
    gone = shifted(BODY, kind, gone.placements, gone.points, 1, share=share)
    assert (np.diff(gone.costs) >= 0).all()
    assert gone.costs[0] <= stay.costs[0]
    assert gone.costs[0] < 0.999 * stay.costs[0] or name in ("IH1", "IH2", "IH3", "IH7", "IH28")
    assert (gone.placements.lengths.sum(axis=1) == BODY.size).all()
    corners = np.column_stack([gone.placements.lengths, gone.placements.starts])
    assert len(np.unique(corners, axis=0)) == len(corners)


def test_it_can_be_cancelled() -> None:
    cancel = Cancel()
    cancel.cancel()
    placements = best_placements(CLASSES["IH4"], complex_points(RING), 2)
    with pytest.raises(Cancelled):
        shifted(BODY, CLASSES["IH4"], placements, at_rest(BODY, 2), 1, share=1.0, cancel=cancel)
