"""What the tests protect: how many of N random changes of the source make a test fail.

    python benchmarks/mutations.py RECORD [--count 200] [--seed 0] [--rooms symmetry tiles/search ...]
        [--again FILE] [--out FILE] [--seconds 40] [--processes 1]

RECORD is a folder of what each test reaches and how long it takes. If it is not there, the whole
suite runs once to make it, which needs the package coverage (`pip install coverage`) and about twice
the time of the suite; later runs read it. Printed first are the shares of lines and of branches that
tests reach.

A mutation is one change of one place: a comparison, a sign, a number, `and` for `or`, a condition that
always holds or never does, an argument left out, a result that is None. Those tests that reach its line
run in a copy of the checkout, the quickest of its own room first, `--seconds` of them at most by the
record's clock, until one fails. Printed are each room's numbers of mutations that were caught,
survived, or lie where no test goes, and then each survivor, so that a person can see whether it
matters: some change nothing. What processes of their own reach is not seen by the record.

`--out` keeps the mutations as JSON, and `--again` takes those of an earlier run instead of random ones,
for instance after tests have changed. Where the source of one has changed since, another of its room is
drawn.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import copy
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Generator, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from queue import Queue
from typing import Any

import pytest

coverage: Any = import_module("coverage") if find_spec("coverage") else None
ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "orbiflow"
OTHER: dict[type[ast.AST], type[ast.AST]] = {
    **{ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq},
    **{ast.NotEq: ast.Eq, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn},
    **{ast.NotIn: ast.In, ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div},
    **{ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.And: ast.Or, ast.Or: ast.And},
}
"""What stands instead of an operator."""


@dataclass(frozen=True)
class Mutation:
    """One change: in `line`, the `place`-th of its file that reads so, `text` from `start` to `end`."""

    file: str
    number: int
    line: str
    place: int
    start: int
    end: int
    text: str
    result: str = ""

    @property
    def room(self) -> str:
        parts = Path(self.file).parts
        return "/".join(parts[: min(2, len(parts) - 1)]) or "root"

    def changed(self) -> str | None:
        """The whole text of its file after the change, or None where its line is no longer there."""
        path = SOURCE / self.file
        lines = path.read_text().splitlines(keepends=True) if path.exists() else []
        places = [i for i, line in enumerate(lines) if line == self.line]
        if len(places) <= self.place:
            return None
        encoded = self.line.encode()
        whole = encoded[: self.start] + self.text.encode() + encoded[self.end :]
        lines[places[self.place]] = whole.decode()
        return "".join(lines)

    def __str__(self) -> str:
        encoded = self.line.encode()
        before, old = encoded[: self.start].decode(), encoded[self.start : self.end].decode()
        code = f"{before}[{old} -> {self.text}]{encoded[self.end :].decode()}"
        return f"{self.file}:{self.number}: {code.strip()}"


def other_node(node: ast.AST, rng: random.Random) -> ast.expr | None:
    """The node that stands instead of this one, if there is one."""
    new: Any = copy.deepcopy(node)
    match node:
        case ast.Compare(ops=[operator]) if type(operator) in OTHER:
            new.ops = [OTHER[type(operator)]()]
        case ast.BinOp(op=operator) | ast.BoolOp(op=operator) if type(operator) in OTHER:
            new.op = OTHER[type(operator)]()
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            new = new.operand
        case ast.Constant(value=bool()):
            new.value = not node.value
        case ast.Constant(value=int(number)):
            new.value = number + 1
        case ast.Constant(value=float(number)):
            new.value = 2 * number or 1.0
        case ast.Call(args=arguments, keywords=keywords) if arguments or keywords:
            place = rng.randrange(len(arguments) + len(keywords))
            del (new.args if place < len(arguments) else new.keywords)[
                place if place < len(arguments) else place - len(arguments)
            ]
        case _:
            return None
    return new


def expressions(tree: ast.AST, rng: random.Random) -> Iterator[tuple[ast.expr, ast.expr]]:
    """Pairs of an expression and what can stand instead; not in annotations nor in messages."""
    for field, value in ast.iter_fields(tree):
        if field in ("annotation", "returns", "decorator_list", "type_comment"):
            continue
        for node in value if isinstance(value, list) else [value]:
            if not isinstance(node, ast.AST) or isinstance(node, ast.JoinedStr | ast.Import):
                continue
            if isinstance(node, ast.expr) and (new := other_node(node, rng)):
                yield node, new
            if isinstance(node, ast.Return) and node.value and ast.unparse(node.value) != "None":
                yield node.value, ast.Constant(None)
            if isinstance(node, ast.If | ast.IfExp | ast.While):
                answer = False if isinstance(node, ast.While) else rng.random() < 0.5
                yield node.test, ast.Constant(answer)
            yield from expressions(node, rng)


def mutations(rooms: list[str], seed: int) -> Iterator[Mutation]:
    """All changes of these rooms (all rooms without any), each once, in random order."""
    rng = random.Random(seed)
    places: list[Mutation] = []
    for path in sorted(SOURCE.rglob("*.py")):
        file, lines = (
            path.relative_to(SOURCE).as_posix(),
            path.read_text().splitlines(keepends=True),
        )
        if rooms and not any(file.startswith(f"{room}/") or file == room for room in rooms):
            continue
        for node, new in expressions(ast.parse(path.read_text()), rng):
            if node.end_lineno == node.lineno and node.end_col_offset is not None:
                line, number = lines[node.lineno - 1], node.lineno
                place = lines[: number - 1].count(line)
                bounds = node.col_offset, node.end_col_offset
                places.append(Mutation(file, number, line, place, *bounds, f"({ast.unparse(new)})"))
    rng.shuffle(places)
    yield from places


class Record:
    """What each test function reaches, and its seconds."""

    def __init__(self, folder: Path) -> None:
        if not folder.exists():
            environment = os.environ | {"ORBIFLOW_RECORD": str(folder.resolve())}
            environment["PYTHONPATH"] = os.pathsep.join(
                [str(SOURCE.parent), str(ROOT / "benchmarks"), os.environ.get("PYTHONPATH", "")]
            )
            command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "--dist", "worksteal"]
            subprocess.run([*command, "-p", "mutations"], cwd=ROOT, env=environment, check=False)
        self.data = coverage.CoverageData(str(folder / "whole"))
        if not (folder / "whole").exists():
            for path in sorted(folder.glob("data.*")):
                part = coverage.CoverageData(str(path))
                part.read()
                self.data.update(part)
            self.data.write()
        self.data.read()
        self.base = next(f for f in self.data.measured_files() if f.endswith("orbiflow/errors.py"))
        self.seconds: Counter[str] = Counter()
        for path in folder.glob("seconds-*.json"):
            for name, seconds in json.loads(path.read_text()).items():
                self.seconds[name.split("[")[0]] += seconds

    @cache  # noqa: B019 (one record a run)
    def by_line(self, file: str) -> dict[int, set[str]]:
        """The test functions that reach each line of a file."""
        path = str(Path(self.base).parent / file)
        tests = self.data.contexts_by_lineno(path)
        return {line: set(names) & self.seconds.keys() for line, names in tests.items()}

    def tests(self, mutation: Mutation, limit: float) -> list[str]:
        """The tests of a mutation in their order; of what is run at import, those of the whole file."""
        lines = self.by_line(mutation.file)
        names = lines.get(mutation.number, set())
        if mutation.number in lines and not names:
            names = set().union(*lines.values())
        room = f"tests/{mutation.room}/"
        order = sorted(
            names, key=lambda name: (not name.startswith(room), self.seconds[name], name)
        )
        kept, total = [], 0.0
        for name in order:
            if (ROOT / name.split("::")[0]).exists() and (not kept or total < limit):
                kept.append(name)
                total += self.seconds[name]
        return kept

    def totals(self) -> str:
        """The shares of lines and of branches that are reached."""
        measure = coverage.Coverage(
            data_file=self.data.data_filename(), branch=True, config_file=False
        )
        measure.load()
        counts = Counter()
        for file in self.data.measured_files():
            with contextlib.suppress(coverage.exceptions.CoverageException):
                numbers = measure._analyze(file).numbers  # pyright: ignore[reportPrivateUsage]
                counts["lines"] += numbers.n_statements
                counts["missing"] += numbers.n_missing
                counts["branches"] += numbers.n_branches
                counts["not taken"] += numbers.n_missing_branches
        lines, branches = counts["lines"], counts["branches"]
        return (
            f"{len(self.seconds)} test functions, {lines - counts['missing']} of {lines} lines "
            f"({1 - counts['missing'] / lines:.1%}), {branches - counts['not taken']} of {branches} "
            f"branches ({1 - counts['not taken'] / branches:.1%})"
        )


def outcome(mutation: Mutation, tests: list[str], limit: float, folder: Path) -> str:
    """Whether one of the tests fails in a copy of the checkout with this change."""
    if not tests:
        return "not reached"
    path = folder / "src" / "orbiflow" / mutation.file
    text = path.read_text()
    path.write_text(mutation.changed() or text)
    environment = os.environ | {"PYTHONPATH": str(folder / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    run = subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        return "survived" if run.wait(60 + 5 * limit) in (0, 5) else "caught"
    except subprocess.TimeoutExpired:
        return "caught"  # it does not end, as a loop that counts wrongly
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(run.pid, 9)
        path.write_text(text)


def measured(
    chosen: list[Mutation], record: Record, seconds: float, processes: int
) -> list[Mutation]:
    """The mutations with their results; each process has a copy of the checkout."""
    with tempfile.TemporaryDirectory() as top, ThreadPoolExecutor(processes) as pool:
        copies: Queue[Path] = Queue()
        for i in range(processes):
            kept = shutil.ignore_patterns(".git", ".venv", "out", "__pycache__", ".*_cache")
            copies.put(Path(shutil.copytree(ROOT, Path(top) / str(i), ignore=kept)))

        def one(mutation: Mutation) -> Mutation:
            folder = copies.get()
            result = outcome(mutation, record.tests(mutation, seconds), seconds, folder)
            copies.put(folder)
            print(f"{result:12} {mutation}", file=sys.stderr, flush=True)
            return Mutation(**{**asdict(mutation), "result": result})

        for mutation in chosen:
            record.by_line(mutation.file)  # SQLite's connections are of one thread
        return list(pool.map(one, chosen))


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("record", type=Path)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms", nargs="*", default=[])
    parser.add_argument("--again", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--seconds", type=float, default=40.0)
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    if coverage is None:
        parser.error("it needs the package coverage; run pip install coverage")

    fresh = mutations(options.rooms, options.seed)
    if options.again:
        chosen: list[Mutation] = []
        for mutation in (Mutation(**values) for values in json.loads(options.again.read_text())):
            if mutation.changed() is None:
                mutation = next((m for m in fresh if m.room == mutation.room), next(fresh))
            chosen.append(mutation)
    else:
        chosen = [mutation for mutation, _ in zip(fresh, range(options.count), strict=False)]
    record = Record(options.record)
    print(record.totals())
    results = measured(chosen, record, options.seconds, options.processes)
    counts = Counter((mutation.room, mutation.result) for mutation in results)
    print("| room | caught | survived | not reached |\n|---|---|---|---|")
    for room in (*sorted({mutation.room for mutation in results}), "all"):
        row = [
            sum(
                n
                for (place, result), n in counts.items()
                if result == kind and room in (place, "all")
            )
            for kind in ("caught", "survived", "not reached")
        ]
        print(f"| {room} | {' | '.join(map(str, row))} |")
    print(*sorted(f"{m.result}: {m}" for m in results if m.result != "caught"), sep="\n")
    if options.out:
        options.out.write_text(json.dumps([asdict(mutation) for mutation in results], indent=1))


class Recorder:
    """A plugin of pytest that keeps what each test function reaches."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.process, self.seconds = folder, os.getpid(), {}
        self.measure = coverage.Coverage(
            data_file=str(folder / "data"),
            data_suffix=str(self.process),
            branch=True,
            source=[str(SOURCE)],
            config_file=False,
        )
        self.measure.start()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, Any, Any]:
        self.measure.switch_context(item.nodeid.split("[")[0])
        start = time.perf_counter()
        try:
            return (yield)
        finally:
            self.seconds[item.nodeid] = time.perf_counter() - start
            self.measure.switch_context("")

    def pytest_sessionfinish(self) -> None:
        if os.getpid() == self.process:
            self.measure.stop()
            self.measure.save()
            (self.folder / f"seconds-{self.process}.json").write_text(json.dumps(self.seconds))


if __name__ == "__main__":
    main()
elif "ORBIFLOW_RECORD" in os.environ and "PYTEST_XDIST_WORKER" in os.environ:

    def pytest_configure(config: pytest.Config) -> None:
        config.pluginmanager.register(Recorder(Path(os.environ["ORBIFLOW_RECORD"])))
