"""Answers of operations: results that say themselves as rows, words, pictures and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

from orbiflow.runtime.codec import to_json
from orbiflow.runtime.events import Cancel, Event, Note, Written
from orbiflow.runtime.files import write_atomic
from orbiflow.runtime.operations import Sink


class Answer:
    """A result that shows itself: a dataclass with those of these methods that have something to say.

    Its JSON is `to_json` of its fields and properties.
    """

    kind: ClassVar[str] = ""
    """What the answer is, the first entry of its JSON."""

    def table(self) -> Iterable[Mapping[str, Any]]:
        """Return the lines of a table, each by the names of the same columns."""
        return ()

    def words(self) -> Iterable[str | Event]:
        """Return what the user is told: lines of text, and tables."""
        return ()

    def picture(self, form: str) -> bytes:
        """Return the content of a picture, whose form is "png", "pdf" or "svg"."""
        raise NotImplementedError

    def content(self, ending: str) -> bytes:
        """Return the content of a file whose name ends in ".json", ".csv" or as pictures do."""
        if ending == ".json":
            return json.dumps(to_json(self), allow_nan=False, indent=1).encode()
        if ending == ".csv":
            rows = list(self.table())
            return csv_bytes(list(rows[0]), [list(row.values()) for row in rows])
        return self.picture(ending[1:])


def emit(answer: Answer, tell: Sink, cancel: Cancel, *files: Path | None) -> None:
    """Write an answer to files, each as its name ends, and tell what it says.

    All contents are made before the first file is written, and none if the work was cancelled.
    """
    contents = {file: answer.content(file.suffix.lower()) for file in files if file is not None}
    cancel.check()
    for file, content in contents.items():
        tell(Written(write_atomic(file, content)))
    for line in answer.words():
        tell(Note(line) if isinstance(line, str) else line)
    for file in contents:
        tell(Note(f"written to {file}"))


def p_in_words(p: float) -> str:
    """Return a probability of a test in two digits, or that it is too small to tell.

    >>> p_in_words(0.0123), p_in_words(1e-320)
    ('0.012', '< 1e-300')
    """
    return f"{p:.2g}" if p > 1e-300 else "< 1e-300"


def csv_bytes(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """Return a CSV as UTF-8."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows([heads, *rows])
    return text.getvalue().encode("utf-8", "replace")
