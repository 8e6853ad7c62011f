"""Events go to JSON and back."""

import json
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.errors import SettingError
from orbiflow.runtime import (
    ClassFailed,
    Event,
    Failed,
    Finished,
    ItemDone,
    Note,
    Preview,
    Progress,
    Started,
    Table,
    TileFound,
    Written,
    call_from_json,
    event_from_json,
)
from refusals import refused

numbers = st.floats(allow_nan=False, allow_infinity=False)
words = st.text()
rows = st.lists(words).map(tuple)
plain = st.recursive(
    st.none() | st.booleans() | st.integers() | numbers | words,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(words, inner, max_size=3),
    max_leaves=8,
)
EVENTS = st.one_of(
    st.builds(Started, words),
    st.builds(Note, words, st.booleans()),
    st.builds(Table, words, rows, st.lists(rows).map(tuple)),
    st.builds(Progress, numbers, words, st.none() | words, *[st.none() | numbers] * 2),
    st.builds(Preview, words, numbers, numbers),
    st.builds(TileFound, words, numbers, numbers, st.booleans()),
    st.builds(ClassFailed, words, words),
    st.builds(ItemDone, words, st.sampled_from(["done", "nothing found", "failed"]), words),
    st.builds(Written, st.text(st.characters(exclude_characters="\0"), min_size=1).map(Path)),
    st.builds(
        Finished,
        st.sampled_from(["done", "nothing found", "cancelled"]),
        st.dictionaries(words, plain, max_size=4),
    ),
    st.builds(Failed, words, st.sampled_from(["mistake", "error", "died"])),
)


@given(EVENTS)
def test_to_json_and_back(event: Event) -> None:
    text = json.dumps(event.to_json(), allow_nan=False)
    assert "\n" not in text  # one line each
    assert event_from_json(json.loads(text)) == event


@pytest.mark.parametrize(
    ("document", "about"),
    [
        ("note", ()),
        ({"kind": "escherize"}, ("escherize",)),
        ({"kind": "note"}, ("text",)),
        ({"kind": "note", "text": 3}, ("text", 3)),
        ({"kind": "note", "text": "", "more": 1}, ("note", "more")),
        ({"kind": "progress", "share": float("nan"), "what": ""}, ("share",)),
        ({"kind": "finished", "state": "done", "summary": {"a": float("nan")}}, ("summary",)),
    ],
)
def test_what_is_no_event(document: object, about: tuple[object, ...]) -> None:
    with refused(*about, kind=SettingError):
        event_from_json(document)


def test_the_page_names_all_events_and_a_call_that_can_be_made() -> None:
    page = (Path(__file__).parents[2] / "docs" / "operations.md").read_text(encoding="utf-8")
    table = page[page.index("| event") : page.index("Events of several")]
    named = {name for row in table.splitlines() for name in re.findall(r"`([A-Z]\w+)`", row[:40])}
    assert named == {kind.__name__ for kind in Event.__subclasses__()}
    (text,) = re.findall(r"```json\n(.*?)```", page, flags=re.DOTALL)
    assert call_from_json(json.loads(text)).to_json()["classes"] == ["IH4", "IH6"]
