"""Operations: their arguments, events, JSON forms and schemas."""

import json
import pickle
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Any

import jsonschema
import pytest

from docs.reference.make import reference
from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.runtime import (
    Cancel,
    Cancelled,
    Event,
    Failed,
    Finished,
    Note,
    Operation,
    Outcome,
    Sink,
    Started,
    call_from_json,
    find,
    ignore,
    operation,
)
from orbiflow.settings import OPERATIONS, Needs, Range, Settings
from refusals import refused

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "settings.md"


class Loudness(Settings):
    """How loud it is, for tests."""

    volume: Annotated[int, Range(0, 11)] = 5
    """How loud."""


@operation("greet")
def greet(
    name: str,
    settings: Loudness = Loudness(),  # noqa: B008
    *,
    times: Annotated[int, Range(1)] = 1,
    twice: Annotated[bool, Needs("name")] = False,
    on_event: Sink = ignore,
    cancel: Cancel = Cancel(),  # noqa: B008
) -> Outcome:
    """Greet somebody.

    Args:
        name: Who is
            greeted.
        times: How often.
    """
    if name == "nobody":
        raise SettingError("{name} must be somebody")
    cancel.check()
    on_event(Note(f"hello {name}"))
    return Outcome({"volume": settings.volume, "times": times, "twice": twice})


GREET: Operation = greet.__dict__["operation"]


def test_a_call_from_python_is_checked_and_told() -> None:
    told: list[Event] = []
    assert greet("you", on_event=told.append).summary["volume"] == 5
    assert [type(event) for event in told] == [Started, Note, Finished]
    with refused("times", 1, kind=SettingError):
        greet("you", times=0)
    with refused("settings", "Loudness", kind=SettingError):
        greet("you", {"volume": 3})  # pyright: ignore[reportArgumentType]


def test_failures_and_stops_are_told_and_what_a_sink_raises_comes_out() -> None:
    told, cancel = list[Event](), Cancel()
    with pytest.raises(SettingError):
        greet("nobody", on_event=told.append)
    assert told[-1] == Failed("name must be somebody", "mistake")
    cancel.cancel()
    with pytest.raises(Cancelled):
        greet("you", on_event=told.append, cancel=cancel)
    assert told[-1] == Finished("cancelled", {})

    def sink(event: Event) -> None:
        if isinstance(event, Note):
            raise OSError("full")

    with refused("full", kind=OSError):
        greet("you", on_event=sink)


def test_fields_come_from_the_signature() -> None:
    assert [entry.name for entry in GREET.fields] == ["name", "volume", "times", "twice"]
    name, volume, *_ = GREET.fields
    assert (name.positional, name.doc) == (True, "Who is greeted.")
    assert (volume.positional, volume.doc) == (False, "How loud.")
    assert GREET.doc == "Greet somebody."


def test_a_call_from_one_mapping() -> None:
    call = GREET.call({"name": "you", "volume": 11})
    assert call.arguments["settings"] == Loudness(volume=11)
    assert call.run().summary == {"volume": 11, "times": 1, "twice": False}
    for wrong, about in (({}, "name"), ({"name": "x", "loud": 1}, "loud")):
        with refused(about, kind=SettingError):
            GREET.call(wrong)


@pytest.mark.parametrize(
    "given",
    [
        {"operation": "export", "result": "out", "kerf": "1mm", "cut": "pieces", "bed": [30, 20]},
        {"operation": "escherize", "image": "cat.png", "classes": ["IH4"], "pin": ["1,2"]},
        {"operation": "density fit", "data": "d.csv", "space": "torus", "components": ["flow"]},
    ],
)
def test_json_round_trip(given: dict[str, Any]) -> None:
    document = {"schema_version": 2, **given}
    call = call_from_json(document)
    jsonschema.validate(document, call.operation.schema)
    again = json.loads(json.dumps(call.to_json()))
    jsonschema.validate(again, call.operation.schema)
    assert call_from_json(again) == call == pickle.loads(pickle.dumps(call))


@pytest.mark.parametrize("document", [
    [], {}, {"schema_version": 1, "operation": "export"}, {"schema_version": 2},
    {"schema_version": 2, "operation": "exprot"},
    {"schema_version": 2, "operation": "export"},
    {"schema_version": 2, "operation": "export", "result": "x", "dpi": "300"},
    {"schema_version": 2, "operation": "export", "result": "x", "dpi": True},
])  # fmt: skip
def test_wrong_json_is_refused(document: object) -> None:
    with pytest.raises(OrbiflowError):
        call_from_json(document)


@pytest.mark.parametrize("made", list(map(find, OPERATIONS)), ids=lambda made: made.name)
def test_every_operation_describes_itself(made: Operation) -> None:
    jsonschema.Draft202012Validator.check_schema(made.schema)
    assert find(made.name) is made
    assert made.doc
    assert not [entry.name for entry in made.fields if not entry.doc]


def test_the_reference_page_is_up_to_date() -> None:
    hint = "run python docs/reference/make.py"
    assert PAGE.read_text("utf-8") == reference(list(map(find, OPERATIONS))), hint


def test_operations_are_known_without_numerical_libraries() -> None:
    code = (
        "import sys; from orbiflow.settings import OPERATIONS\n"
        "from orbiflow.runtime import call_from_json, find\n"
        "[find(name).schema for name in OPERATIONS]\n"
        "call_from_json({'schema_version': 2, 'operation': 'export', 'result': 'x'})\n"
        "print({'numpy', 'torch', 'scipy', 'rich', 'cyclopts'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
