"""A run says what makes its best likeness poor, in the terminal and on the page."""

import numpy as np
import pytest

from orbiflow.runtime import Event, Note, Table
from orbiflow.symmetry import wallpaper_group
from orbiflow.tiles import (
    EscherTile,
    Fidelity,
    Rating,
    SearchResult,
    Target,
    Tile,
    index_page,
    run_folder,
    search,
)
from orbiflow.tiles.finding import escherize
from orbiflow.tiles.likeness import Likeness, Recognisability, compare
from orbiflow.tiles.search import why_poor

TARGET = Target.from_polygon([[0, 0], [3, 0], [3.4, 1.2], [2.2, 1.5], [2, 2.8], [0.8, 2.5]])
SAME, KNOWN = compare(TARGET.outline, TARGET.outline), Recognisability(1.0, 1.0, 1.0, 1.0)
GOOD = Fidelity((0.08, 0.07), 0.01, 0.05, 6.0, 0.003, 0.05, 0.2, 6.0)
STRETCHED = Fidelity((0.1, 0.1), 0.9, 0.9, 7.5, 0.005, 0.15, 0.9, 6.0)
LEGS = Fidelity((0.6, 0.5), 0.02, 0.1, 7.5, 0.005, 0.15, 0.9, 9.0)


def tile(
    kept: Fidelity | None = None, known_score: float | None = None, rating: Rating | None = None
) -> EscherTile:
    own = Tile(TARGET.outline, wallpaper_group("p1"), "IH1")
    likeness = Likeness(SAME, KNOWN, fidelity=kept, known_score=known_score)
    return EscherTile(own, likeness=likeness, rating=rating)


def test_what_is_good_needs_no_words() -> None:
    assert why_poor(tile(GOOD)) == ""
    assert why_poor(tile(known_score=0.1)) == ""  # nothing is known of it
    assert why_poor(tile(known_score=0.9, rating=Rating(3))) == ""


def test_each_reason_has_words_of_its_own() -> None:
    thin = tile(GOOD, known_score=tile(GOOD).score / 4)  # such as by its neck
    unmeasured = tile(known_score=0.2, rating=Rating(2))
    assert len({why_poor(own) for own in (tile(), tile(STRETCHED), tile(LEGS), unmeasured)}) == 4
    assert why_poor(thin)


@pytest.mark.parametrize("kept", [GOOD, STRETCHED])
def test_it_is_said_on_the_page(kept: Fidelity) -> None:
    page = index_page([tile(kept)], [TARGET], ["IH1"])
    assert ("Few people would call the first tile a good likeness, because " in page) == (
        kept is not GOOD
    )


@pytest.mark.parametrize("kept", [GOOD, STRETCHED])
def test_it_is_said_after_the_table(kept: Fidelity, tmp_path, monkeypatch) -> None:
    found = SearchResult(TARGET, [tile(kept)])
    monkeypatch.setattr(search, "escherize", lambda *_args, **_settings: found)
    monkeypatch.setattr(run_folder, "write_run", lambda *_args, **_settings: True)
    image, told = tmp_path / "boot.json", list[Event]()
    image.write_text(str(np.round(TARGET.outline, 2).tolist()))
    escherize(image, tmp_path / "out", on_event=told.append)
    table = next(k for k, event in enumerate(told) if isinstance(event, Table))
    after = [event.text for event in told[table:] if isinstance(event, Note)]
    assert any(text == why_poor(tile(STRETCHED)) for text in after) == (kept is STRETCHED)
    assert not any("good likeness" in str(event) for event in told[:table])
