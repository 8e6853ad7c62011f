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
from orbiflow.runtime import ResultFolder
from reproduction.exhibit import FAST, FULL, Exhibit
from reproduction.reproduction import EXHIBITS, reproduce, write_page, written_files


def main(words: list[str] | None = None) -> int:
    """Draw the exhibits that are asked for; return the exit status: 0, or 2 for a user's mistake."""
    parser = argparse.ArgumentParser(prog="python -m reproduction", description=__doc__)
    add = parser.add_argument
    add("-o", "--out", type=Path, default=Path("paper"), help="folder for the page (default paper)")
    add("--fast", action="store_true", help="a preview: less work in each exhibit")
    add("--only", help="exhibits, such as figure-9,table-3; default all")
    add("--workers", type=int, default=os.cpu_count(), help="processes; default one for each core")
    options = parser.parse_args(words)
    torch.set_num_threads(1)  # many small operations; and workers may be forked
    try:
        _reproduce(options.out, options.fast, _chosen(options.only), options.workers)
    except OrbiflowError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def _reproduce(out: Path, fast: bool, chosen: list[Exhibit], workers: int) -> None:
    begin, extent = time.perf_counter(), FAST if fast else FULL
    if workers < 1:
        raise OrbiflowError(f"--workers must be at least 1, got {workers}")
    with ResultFolder(out, written_files).replaced() as staged:
        shown = reproduce(
            chosen,
            extent,
            staged,
            workers=workers,
            progress=lambda share, what: print(f"{share:4.0%} {what}", flush=True),
        )
        write_page(shown, extent, staged, time.perf_counter() - begin)
    seconds = time.perf_counter() - begin
    print(f"written to {out} in {seconds:.0f} s; open {out / 'index.html'}")
    for one in shown:
        if one.findings is None:
            print(f"{one.exhibit.label} failed: {one.failure}")


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
