"""What the tests protect: how many of N random changes of the source make a test fail.

    python benchmarks/mutations.py [--count 200] [--seed 0] [--seconds 40] [--processes 2]
        [--before CHECKOUT] [--keep FOLDER]

A mutation is one change of one place in a function: a comparison, a sign, a number, `and` for `or`, a
condition turned round, a call left out. The whole suite runs once in a copy of the checkout that marks
the chosen places, to know which tests reach them. Then each change is made in a copy, and those tests
run, the quickest first, `--seconds` of them and a dozen others at most, until one fails. Printed are
how many were caught, survived, or lie where no test goes, and all but the first: some change nothing.

With `--before`, only places are chosen whose function reads the same in that other checkout, and of
what survived here the tests of its room there are tried, too: what they catch is what was lost since.
`--keep` is the folder that keeps what was done, so that a run which was ended goes on.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from queue import Queue
from typing import Any, NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
MARKS = "ORBIFLOW_MARKS"
"""The variable that names the folder of what is marked."""

OTHER: dict[type[ast.AST], Any] = {
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq},
    **{ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn},
    **{ast.NotIn: ast.In, ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div},
    **{ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.And: ast.Or, ast.Or: ast.And},
}
"""What stands instead of an operator."""

Function = ast.FunctionDef | ast.AsyncFunctionDef
SKIPPED = (
    Function | ast.ClassDef | ast.Raise | ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom
)
"""What holds no place: other functions have places of their own, and messages are words."""


class Place(NamedTuple):
    """A node that can be changed: the statement that holds it, and where its parent keeps it."""

    statement: ast.stmt
    parent: ast.AST
    field: str
    number: int | None
    node: Any


class Mutation(NamedTuple):
    """A change of a function, by its text and the number of the place."""

    text: str
    place: int


def can_change(node: ast.AST) -> bool:
    """Return whether there is something that stands instead of a node."""
    match node:
        case ast.Compare(ops=[operator]):
            return type(operator) in OTHER
        case ast.BinOp(op=operator):  # texts are not subtracted
            return type(operator) in OTHER and not re.search("['\"]", ast.unparse(node))
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            return not isinstance(operand, ast.Constant)
        case ast.Constant(value=bool() | int() | float()) | ast.Expr(value=ast.Call()):
            return True
        case _:
            return isinstance(node, ast.BoolOp | ast.If)


def places(function: ast.stmt) -> list[Place]:
    """Return what can be changed in a function, in order."""

    def within(node: ast.AST, statement: ast.stmt | None) -> Iterator[Place]:
        for field, value in ast.iter_fields(node):
            if field in ("annotation", "returns", "decorator_list", "args"):
                continue
            for number, child in enumerate(value if isinstance(value, list) else [value]):
                if not isinstance(child, ast.AST) or isinstance(child, SKIPPED):
                    continue
                holder = child if isinstance(child, ast.stmt) else statement
                if holder is not None and can_change(child):
                    place = number if isinstance(value, list) else None
                    yield Place(holder, node, field, place, child)
                yield from within(child, holder)

    return list(within(function, None))


def functions(path: Path) -> tuple[ast.Module, list[Function]]:
    """Return a module and its functions."""
    module = ast.parse(path.read_text("utf-8"))
    return module, [node for node in ast.walk(module) if isinstance(node, Function)]


def homes(checkout: Path) -> dict[str, list[Path]]:
    """Return in which files of a checkout there is a function, by its text."""
    found: dict[str, list[Path]] = defaultdict(list)
    for path in sorted((checkout / "src").rglob("*.py")):
        for function in functions(path)[1]:
            found[ast.unparse(function)].append(path.relative_to(checkout))
    return found


def change(place: Place) -> str:
    """Change a place, and say how."""
    node, before = place.node, ast.unparse(place.node).splitlines()[0]
    new = node
    match node:
        case ast.Compare():
            node.ops = [OTHER[type(node.ops[0])]()]
        case ast.BinOp() | ast.BoolOp():
            node.op = OTHER[type(node.op)]()
        case ast.UnaryOp():
            new = node.operand
        case ast.Constant(value=bool()):
            new = ast.Constant(not node.value)
        case ast.Constant(value=int(number) | float(number)):
            new = ast.Constant(number + 1)
        case ast.If():
            node.test = ast.UnaryOp(ast.Not(), node.test)
        case _:
            new = ast.Pass()
    if place.number is None:
        setattr(place.parent, place.field, new)
    else:
        getattr(place.parent, place.field)[place.number] = new
    return f"{before}  ->  {ast.unparse(ast.fix_missing_locations(new)).splitlines()[0]}"


class Marking(ast.NodeTransformer):
    """Puts a mark before each of some statements, by their identity."""

    def __init__(self, marks: dict[int, list[int]]) -> None:
        self.marks = marks

    def visit(self, node: ast.AST) -> Any:
        self.generic_visit(node)
        numbers = self.marks.get(id(node), [])
        calls = (f"__import__('mutations').mark({number})" for number in numbers)
        return [*(ast.parse(call).body[0] for call in calls), node] if numbers else node


MET: set[tuple[int, str]] = set()


def note(*words: object) -> None:
    """Append a line to this process's file, where marks are kept."""
    if MARKS in os.environ:  # not by what tests replace
        path = f"{os.environ[MARKS]}/{os.getpid()}"
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.write(file, ("\t".join(map(str, words)) + "\n").encode())
        os.close(file)


def mark(number: int) -> None:
    """Note that a test, or a process of it, reaches a place."""
    test = os.environ.get("PYTEST_CURRENT_TEST", "").rpartition(" (")[0]
    if test and (number, test) not in MET:
        MET.add((number, test))
        note("met", number, test)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note how long tests take, and which fail unchanged; pytest calls this."""
    if "PYTEST_XDIST_WORKER" in os.environ:
        note("failed" if report.failed else "took", report.duration, report.nodeid)


def copied(checkout: Path, folder: Path) -> Path:
    """Return a copy of a checkout."""
    shutil.rmtree(folder, ignore_errors=True)
    left = shutil.ignore_patterns(".git", ".venv", "out", "__pycache__", ".*_cache")
    shutil.copytree(checkout, folder, ignore=left, symlinks=True)
    for words in (["init", "-q"], ["add", "-A"]):  # tests ask for the files that are kept
        subprocess.run(["git", "-C", folder, *words], check=True, capture_output=True)
    return folder


def environment(folder: Path, **more: str) -> dict[str, str]:
    """Return the environment of tests in a copy."""
    paths = f"{folder}/src{os.pathsep}{folder}/tests{os.pathsep}{Path(__file__).parent}"
    return os.environ | {"PYTHONPATH": paths, "OMP_NUM_THREADS": "1", **more}


class Record(NamedTuple):
    """Which tests reach each of some places, how long tests take, and which fail unchanged."""

    met: dict[int, list[str]]
    seconds: dict[str, float]
    failed: list[str]


def record(chosen: list[Mutation], work: Path, processes: int) -> Record:
    """Run the suite in a copy whose chosen places are marked."""
    folder, marks, where = copied(ROOT, work / "marked"), work / "marks", homes(ROOT)
    shutil.rmtree(marks, ignore_errors=True)
    marks.mkdir()
    by_file: dict[Path, list[int]] = defaultdict(list)
    for number, mutation in enumerate(chosen):
        by_file[where[mutation.text][0]].append(number)
    for file, numbers in by_file.items():
        module, own = functions(folder / file)
        of_text = {ast.unparse(function): function for function in own}
        statements: dict[int, list[int]] = defaultdict(list)
        for number in numbers:
            mutation = chosen[number]
            statement = places(of_text[mutation.text])[mutation.place].statement
            statements[id(statement)].append(number)
        marked = ast.fix_missing_locations(Marking(statements).visit(module))
        (folder / file).write_text(ast.unparse(marked), "utf-8")
    command = [sys.executable, "-m", "pytest", "-q", "-n", str(processes), "--dist", "worksteal"]
    subprocess.run(
        [*command, "-p", "mutations"],
        cwd=folder,
        env=environment(folder, **{MARKS: str(marks)}),
        check=False,
    )
    found = Record({number: [] for number in range(len(chosen))}, {}, [])
    for file in marks.iterdir():
        for line in file.read_text().splitlines():
            kind, value, test = line.split("\t")
            if kind == "met":
                found.met[int(value)].append(test)
                continue
            found.seconds[test] = found.seconds.get(test, 0.0) + float(value)
            found.failed.extend([test] * (kind == "failed"))
    return found


def tests_of(number: int, found: Record, seconds: float) -> list[str]:
    """Return the tests that reach a place, the quickest first, and some of those that take longer."""
    known = {test for test in found.met[number] if test in found.seconds} - {*found.failed}
    tests, total, kept = sorted(known, key=lambda test: found.seconds[test]), 0.0, 0
    while kept < len(tests) and (not kept or total < seconds):
        total += found.seconds[tests[kept]]
        kept += 1
    rest = tests[kept:]
    return tests[:kept] + random.Random(number).sample(rest, min(12, len(rest)))


def failing(tests: list[str], folder: Path, limit: float, *more: str) -> list[str] | None:
    """Return which tests fail in a copy of the checkout, None if they do not end."""
    command = [sys.executable, "-m", "pytest", "-q", "-rfE", "-p", "no:cacheprovider", *more]
    how: Any = {"env": environment(folder), "timeout": limit, "capture_output": True}
    try:
        done = subprocess.run([*command, *tests], cwd=folder, text=True, **how)
    except subprocess.TimeoutExpired:
        return None
    lines = [line.split(" - ")[0].split(maxsplit=1) for line in done.stdout.splitlines()]
    named = [words[1] for words in lines if words[:1] in (["FAILED"], ["ERROR"]) and len(words) > 1]
    return named or ([] if done.returncode in (0, 5) else tests)


def outcome(
    mutation: Mutation, home: Path, tests: list[str], folder: Path, limit: float, *, sure: bool
) -> dict[str, str]:
    """Return whether a test fails in a copy of the checkout with a change, and what that is.

    Unless it is `sure` that all tests pass without the change, those that fail are tried without it.
    """
    file = folder / home
    text, (module, own) = file.read_text("utf-8"), functions(file)
    function = next(one for one in own if ast.unparse(one) == mutation.text)
    how = change(places(function)[mutation.place])
    said = {"file": str(home), "function": function.name, "change": how, "result": "not reached"}
    if not tests:
        return said
    file.write_text(ast.unparse(ast.fix_missing_locations(module)), "utf-8")
    failed = failing(tests, folder, limit, *["-x"] * sure)
    file.write_text(text, "utf-8")
    if failed and not sure:
        also = failing(failed, folder, limit)
        failed = None if also is None else sorted({*failed} - {*also})
    # what does not end is caught, too, if tests do otherwise: a loop that counts wrongly
    ends = failed is not None or sure
    result = "survived" if failed == [] else "caught" if ends else "not known"
    return said | {"result": result, "by": (failed or [""])[0]}


def tests_of_room(file: str, checkout: Path) -> list[str]:
    """Return the tests in another checkout of the room that a file is in."""
    folders = [checkout / "tests" / own for own in Path(*Path(file).parts[2:]).parents]
    return [str(next(own for own in folders if own.is_dir()))]


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--before", type=Path)
    parser.add_argument("--keep", type=Path, default=ROOT / "out" / "mutations")
    options = parser.parse_args()
    work: Path = options.keep
    work.mkdir(parents=True, exist_ok=True)
    here, there = homes(ROOT), homes(options.before or ROOT)
    sites = [
        Mutation(text, place)
        for text, files in sorted(here.items())
        if len(files) == 1 == len(there.get(text, []))
        for place in range(len(places(ast.parse(text).body[0])))
    ]
    chosen = random.Random(options.seed).sample(sites, options.count)
    if not (stored := work / "record.json").exists():
        stored.write_text(json.dumps([chosen, *record(chosen, work, options.processes)]))
    marked, met, seconds, failed = json.loads(stored.read_text())
    if marked != [list(mutation) for mutation in chosen]:
        parser.error(f"{work} keeps what was done with other places or another source: remove it")
    found = Record({int(number): tests for number, tests in met.items()}, seconds, failed)

    def results(name: str, checkout: Path, tests: dict[int, list[str]], limit: float) -> Any:
        """Make changes in copies of a checkout, some side by side, and keep what came of them."""
        file, copies, where = work / f"{name}.json", Queue[Path](), homes(checkout)
        done: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
        for number in range(options.processes):
            copies.put(copied(checkout, work / f"{name}-{number}"))

        def one(number: int) -> None:
            folder = copies.get()
            own = [test.replace(str(checkout), str(folder)) for test in tests[number]]
            home = where[chosen[number].text][0]
            sure = checkout == ROOT
            done[str(number)] = outcome(chosen[number], home, own, folder, limit, sure=sure)
            copies.put(folder)
            file.write_text(json.dumps(done, indent=1))

        with ThreadPoolExecutor(options.processes) as pool:
            list(pool.map(one, [number for number in tests if str(number) not in done]))
        return done

    every = {number: tests_of(number, found, options.seconds) for number in range(len(chosen))}
    now = results("now", ROOT, every, 90 + 5 * options.seconds)
    print(dict(Counter(one["result"] for one in now.values())))
    open_ = {int(number): one["file"] for number, one in now.items() if one["result"] != "caught"}
    if old := options.before:
        rooms = {number: tests_of_room(file, old) for number, file in open_.items()}
        before = results("before", old, rooms, 600.0)
        lost = [number for number in open_ if before[str(number)]["result"] == "caught"]
        print(f"caught before, and not now: {len(lost)}")
        print(*(before[str(number)] for number in lost), sep="\n")
    print(*(now[str(number)] for number in open_), sep="\n")


if __name__ == "__main__":
    main()
