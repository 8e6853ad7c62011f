"""Reproduce the paper: `python -m reproduction --out DIR [--fast] [--only figure-9,table-3]`.

One page, DIR/index.html; each picture as PNG and PDF, all numbers in DIR/paper.json.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import torch

from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, ResultFolder
from reproduction.exhibit import FAST, FULL, Exhibit, Shown
from reproduction.page import write_page, written_files
from reproduction.reproduction import EXHIBITS, reproduce


def main(words: list[str] | None = None) -> int:
    """Draw the exhibits that are asked for; return the exit status: 0, or 2 for a user's mistake."""
    options = _parser().parse_args(words)
    torch.set_num_threads(1)  # many small operations; and workers may be forked
    try:
        shown = _reproduced(options)
    except OrbiflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    for one in shown:
        if one.findings is None:
            print(f"{one.exhibit.label} failed: {one.failure}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m reproduction", description=__doc__)
    add = parser.add_argument
    add("-o", "--out", type=Path, default=Path("paper"), help="folder for the page (default paper)")
    add("--fast", action="store_true", help="a preview: less work in each exhibit")
    add("--only", help="exhibits, such as figure-9,table-3; default all")
    add("--workers", type=int, help="number of processes; default one for each core")
    return parser


def _reproduced(options: argparse.Namespace) -> list[Shown]:
    begin = time.perf_counter()
    chosen = _chosen(options.only)
    extent = FAST if options.fast else FULL
    if options.workers is not None and options.workers < 1:
        raise OrbiflowError(f"--workers must be at least 1, got {options.workers}")
    folder = ResultFolder(options.out, written_files)
    with folder.replaced() as staged:
        shown = reproduce(
            chosen,
            extent,
            staged,
            workers=options.workers or os.cpu_count() or 1,
            progress=lambda share, what: print(f"{share:4.0%} {what}", flush=True),
            cancel=Cancel(),
        )
        write_page(shown, extent, staged, time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    print(f"written to {options.out} in {seconds:.0f} s; open {options.out / 'index.html'}")
    return shown


def _chosen(only: str | None) -> list[Exhibit]:
    if only is None:
        return list(EXHIBITS)
    by_name = {exhibit.name: exhibit for exhibit in EXHIBITS}
    names = {name.strip().lower().replace(" ", "-") for name in only.split(",")}
    if unknown := sorted(names - set(by_name)):
        raise OrbiflowError(
            f"--only: the paper has no {unknown[0]!r}; choose among {', '.join(by_name)}"
        )
    return [exhibit for name, exhibit in by_name.items() if name in names]


if __name__ == "__main__":
    sys.exit(main())
