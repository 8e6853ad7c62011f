"""Derived commands: options, help, mistakes in one line, exit statuses."""

import subprocess
import sys
from typing import Any

import pytest

from orbiflow.cli import app
from orbiflow.cli.app import summary
from orbiflow.runtime import Call, Operation, Outcome, find
from orbiflow.settings import OPERATIONS
from refusals import names, refused


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """The JSON forms of what the command line called, without doing it."""
    calls: list[dict[str, Any]] = []

    def run(self: Call, *_: object) -> Outcome:
        calls.append(self.to_json())
        return Outcome()

    monkeypatch.setattr(Call, "run", run)
    return calls


LINES: dict[str, tuple[str, dict[str, Any]]] = {
    "short": ("export X -o a.svg --for laser", {"purpose": "laser"}),
    "equals": ("export X --tile-size=4cm", {"tile_size": 40.0}),
    "flag": ("export X --cut skeleton --clip --border", {"clip": True, "border": True}),
    "off": ("export X --whole", {"clip": False}),
    "size": ("export X --bed 3x2cm", {"bed": [30.0, 20.0]}),
    "repeated": ("escherize X --pin 1,2 --pin=-3,4,5", {"pin": ["1,2", "-3,4,5"]}),
    "all": ("escherize X --classes all", {"classes": ["all"]}),
    "commas": ("escherize X --classes IH4,IH6", {"classes": ["IH4", "IH6"]}),
    "negative": ("escherize X --pin -1,2", {"pin": ["-1,2"]}),
    "group": ("density fit X --space torus --columns a,b", {"columns": ["a", "b"]}),
    "no header": ("density fit X --space torus --no-header", {"header": False}),
}


@pytest.mark.parametrize("name", LINES)
def test_words_become_settings(name: str, called: list[dict[str, Any]]) -> None:
    line, wanted = LINES[name]
    assert app.run(line.split()) == 0
    assert wanted.items() <= called[0].items()


MISTAKES = {
    **{"export": "RESULT", "export X --tile-size 40": "--tile-size 40 40mm"},
    "export X --cut nome": "--cut none skeleton pieces jigsaw template",
    **{"export X --for lazer": "--for lazer laser", "export X --cutt none": "--cutt --cut"},
    **{"export X --dpi": "--dpi", "export X --dpi nan": "--dpi 1 10000 nan", "export X Y": "'Y'"},
    **{"export X --tile 1 --tile 2": "--tile", "export X --clip --clip": "--clip"},
    **{"export X --clip --whole": "--clip --whole", "export X --whole --clip": "--whole --clip"},
    "export X --spacing 1mm": "--spacing --cut pieces",
    **{"export X --eye 53,66,-3": "--eye 53,66,-3", "export X --kerf 1mm": "--kerf --cut pieces"},
    **{"export X --force=maybe": "--force maybe", "export X -o a.foo": "--out --format"},
    **{"density score X": "--model", "density fitt": "fitt fit", "exprot": "exprot export"},
    "escherize X --strength 2": "--strength --emphasis",
    "density fit X --space sphere --missing marginalise": "--missing torus",
    **{"density plot": "--model", "density plot -m X --columns a,b": "--columns --data"},
    "density plot -m X --drop-missing": "--drop-missing --data",
    "density plot -m X --regions ,": "--regions",
    "density plot -m X --regions 0.5,0.5": "--regions 4",
    "density plot -m X --regions 1.2": "--regions 0 1 1.2",
    "density plot -m X --regions 0.9999999": "1 1e-06",
    "density plot -m X --regions 0.99999 --region-samples 20000": "--region-samples 1000000",
    "density plot -m X --region-samples 20000": "--region-samples --regions",
    "density plot -m X --width 30mm": "--width 40",
    "density plot -m X --width 85": "--width 85",
    "density plot -m X --center north": "--center north",
    **{"density plot -m X --radius 91": "--radius 90", "density compare -m A -d X": "--model"},
    "density compare -m A -m A -d X": "--model",
    "density compare -m A -m B": "--data",
    "density compare -m A -m B -d X --space torus": "--space",
    "density compare-data -d X -d X --space torus": "--data",
    "density compare-data -d X --space torus": "--data",
    "density test -d X -d Y --space torus --tests rao": "--tests rao",
    "density compare -m A -m B -d X -o c.txt": "--out .json .csv",
    "density compare -m A -m B -d X --level 95": "--level 0.5 0.999",
    "density region -m X --mass 95": "--mass 0 1",
    "density region -m X --mass half": "--mass half",
    "density region -m X --mass ,": "--mass",
    "density region -m X --level nan": "--level nan",
    "density region -m X --samples 3": "--samples 1000",
    "density region -m X --mass 0.99999 --samples 20000": "--samples 1000000",
    "density region -m X -o r.txt": "--out .geojson .json .csv",
}


@pytest.mark.parametrize("line", MISTAKES)
def test_mistakes_are_one_line_with_status_2(line: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert app.run(line.split()) == 2
    told = capsys.readouterr()
    assert told.err.startswith("error: ")
    assert told.err.count("\n") == 1
    assert not told.out
    names(told.err, *MISTAKES[line].split())


@pytest.mark.parametrize("made", list(map(find, OPERATIONS)), ids=lambda made: made.name)
def test_help_names_every_option(made: Operation, capsys, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    assert app.run([*made.name.split(), "--help"]) == 0
    text = capsys.readouterr().out
    for entry in made.fields:
        names = [entry.name.upper()] if entry.positional else entry.option.names
        if not any(type(part).__name__ == "Hidden" for part in entry.metadata):
            assert all(name in text for name in names)


def test_a_list_of_commands_imports_none_and_says_what_they_say() -> None:
    said = {name: " ".join(find(name).doc.split("\n\n")[0].split()) for name in OPERATIONS}
    assert said == {name: summary(name) for name in OPERATIONS}
    code = (
        "import sys; from orbiflow.cli.app import run\n"
        "run(['--help']), run(['density', '--help'])\n"
        "print([name for name in sys.modules if 'operations' in name], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "['orbiflow.runtime.operations']"


def test_help_may_be_asked_for_first_or_by_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["--help", "export"], ["density", "--help", "plot"]):
        assert app.run(words) == 0
        assert "--out" in capsys.readouterr().out
    assert app.run([]) == 0
    text = capsys.readouterr().out
    assert all(name in text for name in ("escherize", "export", "density", "--install-completion"))


def test_exit_statuses(monkeypatch: pytest.MonkeyPatch) -> None:
    outcomes = {0: Outcome(), 1: Outcome(state="nothing found"), 130: Outcome(state="cancelled")}
    for status, outcome in outcomes.items():
        monkeypatch.setattr(Call, "run", lambda *_, outcome=outcome: outcome)
        assert app.run(["export", "X"]) == status
    assert Outcome(failed=2).exit_status == 1

    def interrupted(*_: object) -> Outcome:
        raise KeyboardInterrupt

    monkeypatch.setattr(Call, "run", interrupted)
    assert app.run(["export", "X"]) == 130


def test_completion_knows_commands_and_choices_and_others_are_refused() -> None:
    script = app.app_for(["--install-completion"]).generate_completion(shell="bash")
    assert all(word in script for word in ("escherize", "--tile-size", "skeleton"))
    with refused("exprot", kind=ValueError):
        find("exprot")


def test_mistakes_and_help_need_no_numerical_library() -> None:
    lines = (
        *("export X --tile-size 40", "solid X --kind tile --chamfer 9mm"),
        *("density marginal -m X --columns ,", "density conditional -m X --given chi"),
        *("escherize --help", "density", ""),
    )
    code = (
        "import sys; from orbiflow.cli.app import run\n"
        f"for line in {lines}:\n"
        "    run(line.split())\n"
        "    print(line, {'numpy', 'torch', 'scipy'} & set(sys.modules), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    shown = done.stderr.splitlines()
    assert not [line for line in lines if f"{line} set()" not in shown], shown
