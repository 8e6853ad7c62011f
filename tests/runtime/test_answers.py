"""Answers that show themselves, and dataclasses as JSON and back."""

import csv
import json
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import pytest

from orbiflow.runtime import (
    Answer,
    Cancel,
    Cancelled,
    Event,
    Note,
    Table,
    Written,
    emit,
    from_json,
    to_json,
)
from refusals import refused

TABLE = Table("Heights", ("name",), (("a",),))


class Step(NamedTuple):
    size: float
    share: float


@dataclass(frozen=True)
class Part:
    name: str
    heights: tuple[float, ...]
    step: Step | None = None
    by: Literal["F", "t"] = "F"
    counts: dict[str, int] = field(default_factory=dict[str, int])


@dataclass(frozen=True)
class Heights(Answer):
    kind = "heights"

    parts: tuple[Part, ...]
    secret: object = field(repr=False, default=None)

    @property
    def most(self) -> float:
        return max(height for part in self.parts for height in part.heights)

    def table(self) -> list[dict[str, Any]]:
        return [{"name": part.name, "first": part.heights[0]} for part in self.parts]

    def words(self) -> list[str | Event]:
        return [TABLE, "as high as houses"]

    def picture(self, form: str) -> bytes:
        if form == "pdf":
            raise OSError("no ink")
        return form.encode()


PART = Part("a", (1.5, math.inf), Step(0.5, 1.0), "t", {"b": 2})
HEIGHTS = Heights((PART, Part("b", (1.0,))), secret=print)


def test_an_answer_is_written_as_names_end_and_told(tmp_path: Path) -> None:
    files = [tmp_path / name for name in ("h.json", "h.csv", "h.png")]
    told: list[Event] = []
    emit(HEIGHTS, told.append, Cancel(), None, *files)
    assert told[:5] == [*map(Written, files), TABLE, Note("as high as houses")]
    document = json.loads(files[0].read_text())
    assert (document["kind"], document["most"]) == ("heights", None)
    assert set(document) == {"kind", "parts", "most"}
    rows = list(csv.reader(files[1].read_text().splitlines()))
    assert rows == [["name", "first"], ["a", "1.5"], ["b", "1.0"]]
    assert files[2].read_bytes() == b"png"


def test_nothing_is_written_if_something_fails_or_is_cancelled(tmp_path: Path) -> None:
    told: list[Event] = []
    with refused("ink", kind=OSError):
        emit(HEIGHTS, told.append, Cancel(), tmp_path / "h.json", tmp_path / "h.pdf")
    cancel = Cancel()
    cancel.cancel()
    with pytest.raises(Cancelled):
        emit(HEIGHTS, told.append, cancel, tmp_path / "h.json")
    assert not told
    assert not list(tmp_path.iterdir())


def test_dataclasses_come_back() -> None:
    assert from_json(Part, json.loads(json.dumps(to_json(PART)))) == PART


@pytest.mark.parametrize(
    ("change", "about"),
    [
        ({"more": 1}, "unknown more"), ({"name": 3}, "name str 3"),
        ({"heights": [1.0, "x"]}, "heights float"), ({"heights": [True]}, "heights float"),
        ({"heights": [math.nan]}, "heights float"), ({"heights": 1.0}, "heights"),
        ({"step": [1.0]}, "step"), ({"by": "z"}, "by"), ({"counts": {"b": 0.5}}, "counts int"),
    ],
)  # fmt: skip
def test_other_documents_are_refused(change: dict[str, Any], about: str) -> None:
    with refused(*about.split()):
        from_json(Part, to_json(PART) | change)
    with refused("missing", "heights"):
        from_json(Part, {"name": "a"})
    with refused("Part"):
        from_json(Part, [])
