"""Shell lines of Markdown pages, and whether the commands in them would be accepted.

Nothing of what a line asks for is done: `refusal` reads the words of a command and stops.
"""

import argparse
import itertools
import re
import runpy
import shlex
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest

from orbiflow.cli import app
from orbiflow.runtime import Call, Outcome, find
from orbiflow.settings import OPERATIONS

ROOT = Path(__file__).parents[1]

ELSEWHERE = {".", "awk", "cd", "dask", "git", "gh", "ogr2ogr", "open", "python3.11", "twine"}
"""Programs that orbiflow does not bring, whose words are not looked at."""

FENCE = re.compile(r"^( *)```(\w*)\n(.*?)^\1```$", re.DOTALL | re.MULTILINE)
INDENTED = re.compile(r"(?:^ {4}.*\n?)+", re.MULTILINE)
SPAN = re.compile(r"(?<!`)`((?:orbiflow|make|python|sh)\s[^`]+)`(?!`)")


@dataclass(frozen=True)
class Line:
    """A command on a page.

    Attributes:
        page: The page's path from the root of the repository.
        text: The command as it is printed, its continuation lines joined.
        whole: Whether it stands in a block of its own; in running text arguments may be left out.
    """

    page: str
    text: str
    whole: bool

    @property
    def words(self) -> list[str]:
        """The words that a shell would pass on; comments are dropped."""
        return shlex.split(self.text, comments=True)


@dataclass(frozen=True)
class Refusal:
    """Why a command would not be accepted.

    Attributes:
        reason: What is wrong, in words.
        incomplete: Whether the only thing wrong is that something required was left out.
    """

    reason: str
    incomplete: bool = False


def lines(page: Path) -> Iterator[Line]:
    """Yield every command that a page prints: first those of blocks, then those in its text."""
    text, name = page.read_text(encoding="utf-8"), page.relative_to(ROOT).as_posix()
    for _, language, block in FENCE.findall(text):
        if language == "sh":
            yield from (Line(name, command, whole=True) for command in _commands(block))
    text = FENCE.sub("", text)
    for block in INDENTED.findall(text):
        for command in _commands(block):
            if command.startswith(("orbiflow ", "make ", "python ", "sh ")):
                yield Line(name, command, whole=True)
    for span in SPAN.findall(text):
        yield Line(name, " ".join(span.split()), whole=False)


def _commands(block: str) -> Iterator[str]:
    """Yield the commands of a block; one may go on over several lines, also inside quotes."""
    command = ""
    for line in block.splitlines():
        command = f"{command}\n{line.strip()}" if command else line.strip()
        if command.endswith("\\"):
            command = command[:-1].rstrip()
            continue
        try:
            words = shlex.split(command, comments=True)
        except ValueError:  # a quotation that the next line ends
            continue
        if words:
            yield command
        command = ""
    if command:
        raise ValueError(f"a command does not end: {command}")


def refusal(words: Sequence[str]) -> Refusal | None:
    """Return why a command would be refused, or None if it would be accepted.

    Files that it would read need not exist.
    """
    program, *rest = words
    if program == "orbiflow":
        return refusal_by_orbiflow(rest)
    if program == "make":
        return _refusal_by_make(rest)
    if program in ("python", "sh"):
        return _refusal_by_script(rest)
    if program == "pip":
        return _refusal_by_pip(rest)
    return None if program in ELSEWHERE else Refusal(f"nothing is known of the program {program!r}")


def refusal_by_orbiflow(words: Sequence[str]) -> Refusal | None:
    """Return why the command line refuses words after `orbiflow`, or None if it accepts them."""
    read = call_by_orbiflow(words)
    return read if isinstance(read, Refusal) else None


def call_by_orbiflow(words: Sequence[str]) -> Call | Refusal | None:
    """Return the call that words after `orbiflow` ask for, or why they are refused.

    Everything is read and checked as when the command is run, up to the point where its work would
    begin. There is no call where none is needed, as for `--help`.
    """
    if words == ["--install-completion"]:  # which would write into the files of one's shell
        return None
    # what is missing is told first, and a line may leave it out: an unknown option must not pass
    for count in (1, 2):
        name = " ".join(words[:count])
        if name in OPERATIONS and (unknown := _unknown(words[count:], name)):
            return Refusal(f"unknown option {unknown}")
    calls: list[Call] = []

    def kept(call: Call, *_: object) -> Outcome:
        calls.append(call)
        return Outcome()

    told: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Call, "run", kept)
        patch.setattr(app, "_to_standard_error", told.append)
        if app.run(list(words)):
            return Refusal(told[-1], incomplete="is missing; give" in told[-1])
    return calls[0] if calls else None


def _unknown(words: Sequence[str], operation: str) -> str | None:
    options = [entry.option for entry in find(operation).fields]
    known = {"--help", *(name for option in options for name in (*option.names, option.off))}
    names = (word.partition("=")[0] for word in words if word.startswith("--"))
    return next((name for name in names if name not in known), None)


def _refusal_by_make(words: Sequence[str]) -> Refusal | None:
    targets = re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    wrong = [word for word in words if "=" not in word and word not in targets]
    return Refusal(f"no such target: {', '.join(wrong)}") if wrong else None


def _refusal_by_pip(words: Sequence[str]) -> Refusal | None:
    """Look at files of constraints and at optional dependencies of this package."""
    for option, value in itertools.pairwise(words):
        if option == "-c" and not (ROOT / value).is_file():
            return Refusal(f"no such file: {value}")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for asked in re.findall(r"^\.\[(.*)\]$", "\n".join(words), flags=re.MULTILINE):
        if unknown := set(asked.split(",")) - set(project["optional-dependencies"]):
            return Refusal(f"no such optional dependencies: {', '.join(sorted(unknown))}")
    return None


def _refusal_by_script(words: Sequence[str]) -> Refusal | None:
    """Look for a script of the repository, and let a Python script read its options."""
    name, *rest = words
    if name == "-m":
        module = ROOT / rest[0]  # a program of the repository, or of another package
        return _refusal_by_argparse(module, rest[1:]) if module.is_dir() else None
    if "NAME" in name:  # one that stands for many
        return None
    if not (ROOT / name).is_file():
        return Refusal(f"no such script: {name}")
    return _refusal_by_argparse(ROOT / name, rest) if name.endswith(".py") else None


def _refusal_by_argparse(script: Path, words: Sequence[str]) -> Refusal | None:
    """Run a script, or the main module of a folder, until it has read its options."""

    class Accepted(BaseException):
        """The script would now begin its work."""

    class Refused(BaseException):
        """The script's parser has found a mistake."""

    read = argparse.ArgumentParser.parse_args

    def read_only(parser: argparse.ArgumentParser, given: Sequence[str] | None = None) -> None:
        read(parser, given)
        raise Accepted

    def refuse(_parser: argparse.ArgumentParser, message: str) -> None:
        raise Refused(message)

    known = set(sys.modules)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", [str(script), *words])
        patch.syspath_prepend(str(script.parent))
        patch.setattr(argparse.ArgumentParser, "parse_args", read_only)
        patch.setattr(argparse.ArgumentParser, "error", refuse)
        try:
            main = script / "__main__.py" if script.is_dir() else script
            runpy.run_path(str(main), run_name="__main__")
        except Accepted:
            return None
        except Refused as error:
            return Refusal(str(error), incomplete="required" in str(error))
        except SystemExit as leaving:
            return Refusal(f"ended with status {leaving.code} before its options were read")
        finally:
            for module in set(sys.modules) - known:  # another folder has modules of the same name
                if (
                    Path(getattr(sys.modules[module], "__file__", None) or "/").parent
                    == script.parent
                ):
                    del sys.modules[module]
    return Refusal("the script has read no options") if words else None
