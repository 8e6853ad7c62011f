"""The files of a batch, their names, and the journal of what was done to them."""

import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from orbiflow.batch import Entry
from orbiflow.batch.folder import RESERVED, Journal
from orbiflow.batch.work import folder_names, listed, read_file
from orbiflow.errors import InputFileError, OutputError
from orbiflow.runtime import stays_inside
from refusals import refused

letters = st.text("aAbB .-é/", min_size=1, max_size=5)
paths = st.builds("{}.{}".format, letters, st.sampled_from(["png", "svg", "PNG"]))
ENDINGS = (".png", ".svg")


@given(st.lists(paths, unique=True), st.lists(paths, unique=True))
def test_names_are_different_usable_and_stay(first: list[str], added: list[str]) -> None:
    names = folder_names(first, {}, RESERVED)
    later = folder_names(sorted({*first, *added}), names, RESERVED)
    assert {path: later[path] for path in first} == names
    taken = [name.casefold() for name in (*later.values(), *RESERVED)]
    assert len(set(taken)) == len(taken)
    for name in later.values():
        assert re.fullmatch(r"[^\W_][\w.-]*|[\w-][\w.-]*", name)
        assert not name.startswith((".", "-"))


def test_names_of_files_that_have_gone_are_kept_for_them() -> None:
    assert folder_names(["b/cat.png"], {"b-cat.png": "b-cat"}) == {"b/cat.png": "b-cat-png"}


def test_what_is_listed(tmp_path: Path) -> None:
    for name in ("b.png", "a/x.SVG", "a/deep/y.png", ".hidden.png", ".git/z.png", "notes.txt"):
        path = tmp_path / "in" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    folder, out = tmp_path / "in", tmp_path / "out"
    assert listed(folder, ENDINGS, None, out) == ["a/deep/y.png", "a/x.SVG", "b.png"]
    assert listed(folder, ENDINGS, "*.png", out) == ["a/deep/y.png", "b.png"]
    assert listed(folder, ENDINGS, "a/*", out) == ["a/deep/y.png", "a/x.SVG"]
    with refused(folder, 3, "z*", kind=InputFileError):
        listed(folder, ENDINGS, "z*", out)
    with refused(folder, folder / "out", kind=InputFileError):
        listed(folder, ENDINGS, None, folder / "out")
    with refused(folder / "b.png", kind=InputFileError):
        listed(folder / "b.png", ENDINGS, None, out)
    with refused(tmp_path / "nowhere", kind=InputFileError):
        listed(tmp_path / "nowhere", ENDINGS, None, out)
    with refused(folder, ".dat", kind=InputFileError):
        listed(folder, (".dat",), None, out)


def test_what_is_too_large_or_gone(tmp_path: Path) -> None:
    path = tmp_path / "cat.png"
    with refused(path.name, kind=InputFileError):
        read_file(path, 5)
    path.write_bytes(b"12345")
    assert read_file(path, 5) == b"12345"
    with refused(path.name, kind=InputFileError):
        read_file(path, 4)


entries = st.lists(
    st.builds(
        Entry,
        file=st.text(min_size=1),
        name=st.text(min_size=1).filter(stays_inside),
        code=st.text("0123456789abcdef"),
        settings=st.dictionaries(st.text(), st.none() | st.integers() | st.text(), max_size=3),
        version=st.just("1"),
        state=st.sampled_from(["done", "nothing found", "failed"]),
        reason=st.text(),
        best=st.dictionaries(st.text(), st.floats(allow_nan=False, allow_infinity=False)),
        seconds=st.none() | st.floats(0, 1e6),
    ),
    max_size=3,
)


@settings(max_examples=4)
@given(entries, st.data())
def test_a_journal_that_was_cut_short_loses_its_last_entry_at_most(
    tmp_path_factory: pytest.TempPathFactory, added: list[Entry], data: st.DataObject
) -> None:
    path = tmp_path_factory.mktemp("journal") / "batch.jsonl"
    with Journal(path) as journal:
        sizes = [0]
        for entry in added:
            journal.add(entry)
            sizes.append(path.stat().st_size)
    assert Journal(path).entries == {entry.file: entry for entry in added}
    cut = data.draw(st.integers(0, sizes[-1]))
    path.write_bytes(path.read_bytes()[:cut])
    whole = [entry for entry, size in zip(added, sizes[1:], strict=True) if size - 1 <= cut]
    assert Journal(path).entries == {entry.file: entry for entry in whole}
    with Journal(path) as journal:  # and it is whole again
        for entry in added:
            journal.add(entry)
    assert Journal(path).entries == {entry.file: entry for entry in added}


@pytest.mark.parametrize("name", ["/etc", "../up", "a/../../b", "a\\b"])
def test_a_journal_cannot_send_results_elsewhere(name: str, tmp_path: Path) -> None:
    path = tmp_path / "batch.jsonl"
    with Journal(path) as journal:
        journal.add(Entry("a.svg", name, "", {}, "1", "done"))
        journal.add(Entry("b.svg", "b", "", {}, "1", "done"))
    assert list(Journal(path).entries) == ["b.svg"]


def test_what_is_no_journal(tmp_path: Path) -> None:
    path = tmp_path / "batch.jsonl"
    path.write_text("one\ntwo\n")
    with refused(path, kind=OutputError):
        Journal(path)
    with refused(tmp_path):
        Journal(tmp_path)
