"""The table of `same.py`: the folders of two trees, case by case and file by file."""

from __future__ import annotations

import fnmatch
import json
import re
from pathlib import Path

from same_cases import Case, Renamed
from same_files import Finding, Tolerances, compare_files

UNKNOWN = re.compile(r"(no such|unknown|unrecogni[sz]ed) (option|command)", re.IGNORECASE)
"""What is said of an option that is not known: it has another name, which is to be noted."""


def compare_cases(
    cases: list[Case],
    before: Path,
    present: Path,
    renamed: Renamed,
    tolerances: Tolerances,
    *,
    every: bool,
) -> int:
    """Print the table and return how many of its lines differ."""
    print(f"\n{'item':46} {'kind':8} result (tolerance {tolerances.number:g})")
    count = {"same bit for bit": 0, "same": 0, "DIFFERS": 0, "as intended": 0}
    for case in cases:
        for name, finding in compare_case(
            case, before, present, renamed, tolerances, every
        ).items():
            verdict = finding.verdict()
            reason = intended(case.name, name, renamed) if finding.wrong else None
            if reason:
                verdict = f"as intended, {reason}: {verdict}"
            print(f"{case.name + ' ' + name:46} {case.kind:8} {verdict}")
            first = next(word for word in ("as intended", *count) if verdict.startswith(word))
            count[first] += 1
    print("\n" + ", ".join(f"{number} {word}" for word, number in count.items()))
    return count["DIFFERS"]


def intended(case: str, name: str, renamed: Renamed) -> str | None:
    item = f"{case} {name}"
    fits = (
        reason
        for pattern, reason in renamed.expected.items()
        if fnmatch.fnmatch(item, pattern) or fnmatch.fnmatch(case, pattern)
    )
    return next(fits, None)


def compare_case(
    case: Case, before: Path, present: Path, renamed: Renamed, tolerances: Tolerances, every: bool
) -> dict[str, Finding]:
    """Compare the folders of a case; return what was found by name of file."""
    one, two = before / case.name, present / case.name
    found = {"status": Finding(renamed, tolerances)}
    was, now = (
        json.loads((folder / ".done.json").read_text())["statuses"] for folder in (one, two)
    )
    for number, (a, b) in enumerate(zip(was, now, strict=True)):
        if a != b:
            lines = (two / f".errors-{number}").read_text().strip().splitlines()
            told = f" ({lines[-1]})" if lines else ""
            found["status"].wrong.append(f"{case.commands[number]} ended with {b}, was {a}{told}")
        elif case.refused and UNKNOWN.search((two / f".errors-{number}").read_text()):
            found["status"].wrong.append(f"{case.commands[number]}: an option is unknown")
    if case.said:
        words = [re.findall(case.said, said(folder)) for folder in (one, two)]
        found["said"] = Finding(renamed, tolerances)
        found["said"].same(words[0], words[1], "what is printed")
    theirs = {name: path for path in files(one) if (name := renamed_path(path, renamed))}
    ours = {str(path): path for path in files(two)}
    for path in sorted(theirs.keys() | ours.keys()):
        finding = Finding(renamed, tolerances)
        if path not in ours:
            finding.wrong.append(f"{path} is missing")
        elif path not in theirs:
            finding.wrong.append(f"{path} is new")
        else:
            compare_files(one / theirs[path], two / ours[path], path, finding)
        found.setdefault(path if every else Path(path).name, Finding(renamed, tolerances)).absorb(
            finding
        )
    return found


def said(folder: Path) -> str:
    """Return what a case's commands printed."""
    return "\n".join(path.read_text() for path in sorted(folder.glob(".said-*")))


def files(folder: Path) -> list[Path]:
    """Return the files of a case that are compared, relative to its folder."""
    return [
        path.relative_to(folder)
        for path in folder.rglob("*")
        if path.is_file()
        and not any(part.startswith(".") for part in path.relative_to(folder).parts)
    ]


def renamed_path(path: Path, renamed: Renamed) -> str | None:
    """Return what the present tree calls a file of the version before, or None if it is gone."""
    name = renamed.files.get(path.name, path.name)
    return str(path.with_name(name)) if name else None
