"""The same results as the version before? A fixed corpus of command lines, run by both, file by file.

    python benchmarks/same.py [--before DIR] [--cache DIR] [--only PATTERN] [--jobs N] [--slow]

The version before is a checkout of commit 88b4c3b; without `--before` one is made in a temporary
folder. Its results stay in the folder of `--cache`, so that later runs only run the present tree. The
table has a line for each case and kind of file: same bit for bit, same to the greatest relative
difference of its numbers, or DIFFERS and where. Times, versions, paths and words are not compared.
`same_cases.py` has the cases and the table of what has been renamed. Exit status 1 if anything differs.
"""

from __future__ import annotations

import argparse
import atexit
import fnmatch
import hashlib
import importlib
import importlib.util
import json
import os
import re
import resource
import runpy
import shlex
import shutil
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Callable, Iterable
from pathlib import Path

os.environ |= {"OMP_NUM_THREADS": "1", "COLUMNS": "160", "MPLBACKEND": "agg"}

from same_cases import BEFORE, PRESENT, Case, Renamed, corpus
from same_compare import compare_cases
from same_files import Tolerances
from same_inputs import write_inputs

ROOT = Path(__file__).resolve().parents[1]
COMMIT = "88b4c3b"
HEAVY = (
    "torch",
    "scipy.stats",
    "scipy.signal",
    "scipy.optimize",
    "scipy.spatial",
    "shapely",
    "PIL.Image",
)
"""What both trees import in every command: imported once, before the commands are forked."""
DONE = ".done.json"


def main() -> int:
    options = parsed()
    cases = chosen(options.only, slow=options.slow)
    for name in HEAVY:
        importlib.import_module(name)
    scratch = Path(tempfile.mkdtemp(prefix="orbiflow-same-"))
    owner = os.getpid()
    try:
        return 1 if differences(cases, options, scratch) else 0
    finally:
        if os.getpid() == owner:  # children are forked from within
            leave(scratch)


def differences(cases: list[Case], options: argparse.Namespace, scratch: Path) -> int:
    """Run the cases with both trees, print the table and return how many of its lines differ."""
    cache = (options.cache or scratch / "cache").resolve()
    out = emptied((options.keep or scratch / "present").resolve())
    spent_before = run_before(
        with_needs(cases), cache, lambda: checkout(options.before, scratch / "before"), options.jobs
    )
    shutil.copytree(cache / "inputs", out / "inputs")
    (out / "old").symlink_to(cache)
    needed = with_needs(cases)
    spent = run_cases(needed, out, options.present.resolve(), PRESENT, options.jobs)
    print(
        f"processor time: before {spent_before:.0f} s (what the cache lacked), present {spent:.0f} s"
    )
    tolerances = Tolerances(options.tolerance)
    return compare_cases(cases, cache, out, PRESENT, tolerances, every=options.every)


def emptied(folder: Path) -> Path:
    """Return a new folder in the place of an earlier run's, and refuse to remove anything else."""
    if folder.exists() and any(folder.iterdir()) and not (folder / "old").is_symlink():
        raise SystemExit(f"--keep {folder} holds other files: name a new folder")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def parsed() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--before", type=Path, help=f"checkout of {COMMIT}; default: made for the run"
    )
    parser.add_argument(
        "--present", type=Path, default=ROOT, help="the tree to test; default this one"
    )
    parser.add_argument(
        "--cache", type=Path, help="folder that keeps the results of the version before"
    )
    parser.add_argument("--keep", type=Path, help="folder for the present results, emptied first")
    parser.add_argument("--only", default="*", help="cases to run, such as 'fit-*,export-svg'")
    parser.add_argument("--slow", action="store_true", help="also the searches at effort best")
    parser.add_argument("--jobs", type=int, default=1, help="cases at a time")
    parser.add_argument(
        "--tolerance", type=float, default=1e-8, help="greatest relative difference"
    )
    parser.add_argument(
        "--every", action="store_true", help="a line for each file, not for each kind"
    )
    return parser.parse_args()


def chosen(only: str, *, slow: bool) -> list[Case]:
    """Return the cases whose names fit one of the patterns, with commas between."""
    fit = [
        case
        for case in corpus()
        if any(fnmatch.fnmatch(case.name, pattern) for pattern in only.split(","))
        and (slow or not case.slow)
    ]
    if not fit:
        raise SystemExit(f"no case fits {only}; there are " + ", ".join(c.name for c in corpus()))
    return fit


def with_needs(cases: Iterable[Case]) -> list[Case]:
    """Return the cases and those whose folders they read, in the corpus' order."""
    by_name = {case.name: case for case in corpus()}
    wanted: set[str] = set()
    ahead = [case.name for case in cases]
    while ahead:
        case = by_name[ahead.pop()]
        wanted.add(case.name)
        ahead += case.needs & by_name.keys() - wanted
    return [case for case in corpus() if case.name in wanted]


GIT = ("git", "-C", str(ROOT), "worktree")


def checkout(given: Path | None, folder: Path) -> Path:
    """Return a checkout of the version before: the one given, or a new one in `folder`."""
    if given:
        return given.resolve()
    subprocess.run([*GIT, "add", "--detach", str(folder), COMMIT], check=True, capture_output=True)
    return folder


def leave(scratch: Path) -> None:
    """Remove what the run has made for itself."""
    if (scratch / "before").exists():
        subprocess.run([*GIT, "remove", "--force", str(scratch / "before")], check=False)
    shutil.rmtree(scratch)


def run_before(cases: list[Case], cache: Path, tree: Callable[[], Path], jobs: int) -> float:
    """Run what the cache lacks with the version before; return the processor time."""
    keep_inputs(cache / "inputs")
    missing = [case for case in cases if not is_cached(case, cache)]
    if not missing:
        return 0.0
    folder = tree()
    spent = run_cases(missing, cache, folder, BEFORE, jobs)
    if failed := [case.name for case in missing if not is_cached(case, cache)]:
        raise SystemExit("not run as they should with the version before: " + ", ".join(failed))
    return spent


def keep_inputs(folder: Path) -> None:
    """Write the inputs unless they are there: other runs may be reading them."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".inputs-") as scratch:
        new = Path(scratch) / "inputs"
        write_inputs(new, ROOT / "examples")
        if contents(new) != contents(folder):
            shutil.rmtree(folder, ignore_errors=True)
            new.rename(folder)


def contents(folder: Path) -> dict[Path, bytes]:
    """Return the files of a folder and what is in them."""
    paths = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder): path.read_bytes() for path in paths}


def key(case: Case, cache: Path) -> str:
    """Return what a cached result depends on: its commands, its inputs, and the cases it reads."""
    by_name = {case.name: case for case in corpus()}
    whole = hashlib.sha256(json.dumps(case.commands).encode())
    for name in sorted(case.needs & by_name.keys()):
        whole.update(key(by_name[name], cache).encode())
    for name in sorted(set(re.findall(r"\.\./inputs/([\w.-]+)", " ".join(case.commands)))):
        path = cache / "inputs" / name
        for file in sorted(path.iterdir()) if path.is_dir() else [path]:
            whole.update(file.read_bytes() if file.exists() else b"")
    return whole.hexdigest()


def is_cached(case: Case, cache: Path) -> bool:
    record = cache / case.name / DONE
    return record.exists() and json.loads(record.read_text())["key"] == key(case, cache)


def run_cases(cases: list[Case], root: Path, tree: Path, renamed: Renamed, jobs: int) -> float:
    """Run cases, some at a time, each after those that it needs; return the processor time."""
    waiting, running, spent = list(cases), {}, 0.0
    names = {case.name for case in cases}
    done: set[str] = set()
    while waiting or running:
        ready = (case for case in waiting if not case.needs & names - done)
        while len(running) < jobs and (case := next(ready, None)):
            waiting = [other for other in waiting if other is not case]
            running[fork(lambda case=case: run_case(case, root, tree, renamed))] = case
        pid, _, usage = os.wait4(-1, 0)
        if case := running.pop(pid, None):
            seconds = usage.ru_utime + usage.ru_stime
            spent += seconds
            done.add(case.name)
            print(f"  {tree.name}: {case.name} {seconds:.1f} s", file=sys.stderr, flush=True)
    return spent


def run_case(case: Case, root: Path, tree: Path, renamed: Renamed) -> None:
    """Run a case's commands in its folder and record how each ended."""
    folder = root / case.name
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    os.chdir(folder)
    statuses: list[int] = []
    for number, line in enumerate(case.commands):
        pid = fork(lambda line=line, number=number: run_command(line, number, tree, renamed))
        statuses.append(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]))
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    wrong = [number for number, status in enumerate(statuses) if (status == 0) == case.refused]
    if renamed is BEFORE and wrong:  # it would compare nothing: no record
        told = (folder / f".errors-{wrong[0]}").read_text()
        print(f"{case.commands[wrong[0]]} ended with {statuses[wrong[0]]}: {told[-600:]}")
        return
    record = {
        "key": key(case, root),
        "statuses": statuses,
        "seconds": used.ru_utime + used.ru_stime,
    }
    (folder / DONE).write_text(json.dumps(record))


def run_command(line: str, number: int, tree: Path, renamed: Renamed) -> None:
    """Run `python -m orbiflow` with a tree's sources, in this process, which was forked for it."""
    source = str(tree / "src")
    sys.path[:] = [source, *(path for path in sys.path if Path(path or ".") != ROOT / "benchmarks")]
    os.environ["PYTHONPATH"] = source
    found = importlib.util.find_spec("orbiflow")
    if found is None or not str(found.origin).startswith(source):
        raise RuntimeError(
            f"orbiflow would be imported from {found and found.origin}, not {source}"
        )
    sys.argv = ["orbiflow", *in_present_words(shlex.split(line), renamed)]
    for stream, name in ((1, "said"), (2, "errors")):
        file = os.open(f".{name}-{number}", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, stream)
    runpy.run_module("orbiflow", run_name="__main__", alter_sys=True)


def in_present_words(words: list[str], renamed: Renamed) -> list[str]:
    """Return a command line with its options and values as a tree calls them."""
    command = " ".join(words[: 2 if words[0] == "density" else 1])
    new: list[str] = []
    skip = False
    for word in words:
        name, equals, value = word.partition("=") if word.startswith("--") else (word, "", "")
        if skip and not word.startswith("-"):
            skip = False
            continue
        skip = False
        if name.startswith("-"):
            now = renamed.options.get(f"{command} {name}", renamed.options.get(name, name))
            skip = now is None and not equals
            new += [] if now is None else [now + equals + renamed.values.get(value, value)]
        else:
            new.append(",".join(renamed.values.get(part, part) for part in word.split(",")))
    return new


def fork(work) -> int:
    """Start `work` in a child that ends as a process of its own would; return the child's id."""
    sys.stdout.flush()
    sys.stderr.flush()
    if pid := os.fork():
        return pid
    status = 0
    try:
        work()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    finally:
        threading._shutdown()  # pyright: ignore[reportAttributeAccessIssue]
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


if __name__ == "__main__":
    began = time.perf_counter()
    status = main()
    print(f"{time.perf_counter() - began:.0f} s")
    raise SystemExit(status)
