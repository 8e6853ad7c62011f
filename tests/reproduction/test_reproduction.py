"""The runner and the page: shared work is done once, failures are shown and lose nothing else."""

import json
import os
import re
from pathlib import Path

import pytest

from orbiflow.errors import OrbiflowError
from refusals import names
from reproduction.__main__ import main
from reproduction.drawing import Canvas
from reproduction.exhibit import FAST, Exhibit, Extent, Findings, Table, Work
from reproduction.reproduction import reproduce, write_page, written_files


def counted(folder: str, number: int) -> int:
    """Leaves a file each time that it is called."""
    (Path(folder) / f"{number}-{os.urandom(4).hex()}").touch()
    return 10 * number


def broken(_folder: str) -> int:
    raise OrbiflowError("the <work> cannot be done")


def draw_sum(canvas: Canvas, _extent: Extent, values: list[int]) -> Findings:
    figure = canvas.figure(0.02)
    figure.text(0.5, 0.5, str(sum(values)))
    canvas.add(figure, "a <number>", "its caption")
    table = Table("all", ("name", "value"), (("sum", str(sum(values))),))
    return Findings("agrees", "It is so & so.", "A reason.", {"sum": sum(values)}, [table])


def draw_badly(_canvas: Canvas, _extent: Extent, _values: list[int]) -> Findings:
    raise ZeroDivisionError("division by zero")


class Needs:
    """A picklable list of work."""

    def __init__(self, *works: Work) -> None:
        self.works = list(works)

    def __call__(self, _extent: Extent) -> list[Work]:
        return self.works


def exhibit(name: str, draw, *works: Work) -> Exhibit:
    return Exhibit(name, "A title", "A claim.", draw, Needs(*works))


@pytest.mark.parametrize("workers", [1, 2])
def test_equal_work_is_done_once_and_failures_stay_apart(tmp_path: Path, workers: int) -> None:
    traces = tmp_path / "traces"
    traces.mkdir()
    one, two = (Work(counted, (str(traces), k)) for k in (1, 2))
    chosen = [
        exhibit("figure-1", draw_sum, one, two),
        exhibit("figure-2", draw_badly, two),
        exhibit("figure-3", draw_sum, one, Work(broken, (str(traces),))),
        exhibit("figure-4", draw_sum, Work(counted, (str(traces), 2))),
    ]
    shares: list[float] = []
    tell = lambda share, _what: shares.append(share)  # noqa: E731
    found = reproduce(chosen, FAST, tmp_path, workers=workers, progress=tell)
    assert sorted(path.name[0] for path in traces.iterdir()) == ["1", "2"]
    assert [one.exhibit.name for one in found] == [one.name for one in chosen]
    assert [one.findings and one.findings.numbers["sum"] for one in found] == [30, None, None, 20]
    assert found[1].failure == "ZeroDivisionError: division by zero"
    assert found[2].failure == "the <work> cannot be done"
    assert shares == sorted(shares)
    assert shares[-1] == pytest.approx(1.0)


def test_the_page_shows_what_was_drawn_and_what_failed(tmp_path: Path) -> None:
    chosen = [exhibit("figure-1", draw_sum), exhibit("figure-2", draw_badly)]
    shown = reproduce(chosen, FAST, tmp_path)
    write_page(shown, FAST, tmp_path, 3.0)
    page = (tmp_path / "index.html").read_text("utf-8")
    assert '<article id="figure-1">' in page
    assert 'src="figure-1.png" alt="a &lt;number&gt;"' in page
    assert "It is so &amp; so." in page
    assert "Why it differs" in page
    assert '<article id="figure-2">' in page
    assert "Not drawn: ZeroDivisionError: division by zero" in page
    assert "<td>0</td>" in page
    document = json.loads((tmp_path / "paper.json").read_text("utf-8"))
    failures = [entry["failure"] for entry in document["exhibits"]]
    assert failures == [None, "ZeroDivisionError: division by zero"]
    files = {path.name for path in tmp_path.iterdir()}
    figures = {"figure-1.png", "figure-1.pdf"}
    assert written_files(tmp_path) == files == {"index.html", "paper.json", *figures}
    contents = [(tmp_path / name).read_bytes() for name in sorted(figures)]
    assert contents[0].startswith(b"%PDF")
    reproduce(chosen, FAST, tmp_path)  # the same bytes again
    assert contents == [(tmp_path / name).read_bytes() for name in sorted(figures)]


def test_the_snippet_of_the_docs(tmp_path: Path, monkeypatch, capsys) -> None:
    text = (Path(__file__).parents[2] / "docs" / "paper.md").read_text("utf-8")
    (snippet,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(compile(snippet, "paper.md", "exec"), {})
    assert capsys.readouterr().out.startswith("agrees {'B-periodic': ")
    assert (tmp_path / "figures" / "figure-4.pdf").is_file()


def test_the_command_writes_the_folder_whole_and_again(tmp_path: Path, capsys) -> None:
    out = tmp_path / "paper"
    words = ["--out", str(out), "--fast", "--workers", "1", "--only"]
    assert main([*words, "Figure 4,table-1,table-4"]) == 0
    said = capsys.readouterr().out
    assert "failed" not in said
    assert str(out / "index.html") in said
    figures = {"figure-4.png", "figure-4.pdf"}
    assert {path.name for path in out.iterdir()} == {"index.html", "paper.json", *figures}
    document = json.loads((out / "paper.json").read_text("utf-8"))
    assert [entry["name"] for entry in document["exhibits"]] == ["table-1", "figure-4", "table-4"]
    assert main([*words, "table-1"]) == 0
    assert {path.name for path in out.iterdir()} == {"index.html", "paper.json"}


def test_a_folder_of_other_things_is_refused(tmp_path: Path, capsys) -> None:
    (tmp_path / "thesis.tex").touch()
    assert main(["--out", str(tmp_path), "--only", "table-1"]) == 2
    assert "thesis.tex" in capsys.readouterr().err


def test_a_file_of_numbers_cannot_name_others_files(tmp_path: Path) -> None:
    exhibits = [{"files": ["../x.png", "notes.txt", "figure-1.png"]}]
    document = {"schema_version": 1, "exhibits": exhibits}
    (tmp_path / "paper.json").write_text(json.dumps(document))
    assert written_files(tmp_path) == {"paper.json", "index.html", "figure-1.png"}


@pytest.mark.parametrize("words", [("--workers", "0"), ("--only", "figure-99"), ("--only", "")])
def test_mistakes_are_named(tmp_path: Path, capsys, words: tuple[str, str]) -> None:
    assert main(["--out", str(tmp_path / "paper"), *words]) == 2
    names(capsys.readouterr().err, "figure-1" if words[0] == "--only" else "1", words[0])
    assert list(tmp_path.iterdir()) == []
