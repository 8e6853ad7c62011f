"""A folder of results is one run's: replaced whole, or left as it was."""

from collections.abc import Callable
from pathlib import Path

import pytest

from orbiflow.errors import OutputError
from orbiflow.runtime import ResultFolder
from refusals import names, refused

OURS = {"result.json", "IH4/tile.svg", "IH6/tile.svg"}


def folder_at(path: Path) -> ResultFolder:
    return ResultFolder(path, lambda _: OURS)


def fill(folder: Path, *names: str, text: str = "new") -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def run(
    out: Path, *, meanwhile: Callable[[], object] = lambda: None, made: list[Path] | None = None
) -> None:
    """A run with one result."""
    with folder_at(out).replaced() as staged:
        if made is not None:
            made.append(staged)
        fill(staged, "result.json")
        meanwhile()


def files(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): p.read_text() for p in folder.rglob("*") if p.is_file()
    }


def test_a_new_folder_and_its_parents(tmp_path: Path) -> None:
    out = tmp_path / "a" / "b"
    folder = folder_at(out)
    assert not folder.has_a_run
    with folder.replaced() as staged:
        fill(staged, "result.json")
        assert not out.exists()
    assert files(tmp_path) == {"a/b/result.json": "new"}


@pytest.mark.parametrize("place", ["elsewhere", "working directory", "above it"])
def test_an_earlier_run_goes_whole(place: str, tmp_path, monkeypatch) -> None:
    out = tmp_path / "out"
    fill(out, *OURS, text="old")
    (out / ".DS_Store").touch()
    (out / "IH4" / "Thumbs.db").touch()
    if place != "elsewhere":
        at = out if place == "working directory" else out / "IH4"
        monkeypatch.chdir(at)
    folder = folder_at(Path("." if place == "working directory" else out))
    assert folder.has_a_run
    with folder.replaced() as staged:
        fill(staged, "result.json", "IH6/tile.svg")
        assert set(files(out).values()) >= {"old"}
    assert files(tmp_path) == {"out/result.json": "new", "out/IH6/tile.svg": "new"}
    if place == "working directory":
        assert sorted(p.name for p in Path().iterdir()) == ["IH6", "result.json"]


@pytest.mark.parametrize("name", ["notes.txt", "IH4/notes.txt", "IH5/tile.svg", "empty/", ".git/x"])
def test_what_orbiflow_did_not_write_is_refused_by_its_name(name: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    fill(out, *OURS)
    if name.endswith("/"):
        (out / name).mkdir()
    else:
        fill(out, name)
    before = files(tmp_path)
    with refused(out, name.split("/")[0], kind=OutputError):
        folder_at(out)
    assert files(tmp_path) == before


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_the_earlier_run(error: type[BaseException], tmp_path: Path) -> None:
    out = tmp_path / "out"
    fill(out, *OURS, text="old")
    before = files(tmp_path)

    def fail() -> None:
        raise error

    with pytest.raises(error):
        run(out, meanwhile=fail)
    assert files(tmp_path) == before
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_what_came_in_the_meantime_is_kept_and_the_results_too(tmp_path: Path) -> None:
    out = tmp_path / "out"
    fill(out, *OURS, text="old")
    with refused("notes.txt", kind=OutputError) as caught:
        run(out, meanwhile=lambda: fill(out, "notes.txt"))
    assert (out / "notes.txt").exists()
    assert (out / "result.json").read_text() == "old"
    assert files(Path(str(caught.value).rpartition("results are in ")[2])) == {"result.json": "new"}


def test_a_move_that_fails_is_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    fill(out, *OURS, text="old")
    before = files(out)
    rename = Path.rename

    def failing(self: Path, target: Path) -> Path:
        if self.parent in made and target == out / "result.json":
            raise OSError(16, "Device or resource busy")
        return rename(self, target)

    made: list[Path] = []
    monkeypatch.setattr(Path, "rename", failing)
    with refused("busy", kind=OutputError) as caught:
        run(out, made=made)
    names(str(caught.value), made[0])
    assert {name: text for name, text in files(out).items() if "orbiflow" not in name} == before
    assert files(made[0]) == {"result.json": "new"}


def test_a_link_to_a_folder_stays_a_link(tmp_path: Path) -> None:
    fill(tmp_path / "real", *OURS, text="old")
    (tmp_path / "out").symlink_to(tmp_path / "real")
    with folder_at(tmp_path / "out").replaced() as staged:
        fill(staged, "result.json")
    assert (tmp_path / "out").is_symlink()
    assert files(tmp_path / "real") == {"result.json": "new"}


def test_a_link_within_is_no_folder_of_ours(tmp_path: Path) -> None:
    fill(tmp_path / "elsewhere", "tile.svg")
    fill(tmp_path / "out", "result.json")
    (tmp_path / "out" / "IH4").symlink_to(tmp_path / "elsewhere")
    with refused("IH4", kind=OutputError):
        folder_at(tmp_path / "out")


def test_permissions_are_kept(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir(mode=0o750)
    with folder_at(out).replaced():
        pass
    assert out.stat().st_mode & 0o777 == 0o750


def test_a_file_in_the_way(tmp_path: Path) -> None:
    (tmp_path / "wall").write_text("keep me")
    for below in ("", "sub", "sub/folder"):
        with refused(tmp_path / "wall" / below, kind=OutputError):
            folder_at(tmp_path / "wall" / below)
    assert (tmp_path / "wall").read_text() == "keep me"


def test_links_in_a_circle(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to(tmp_path / "b")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    with refused(tmp_path / "a", kind=OutputError):
        folder_at(tmp_path / "a")
