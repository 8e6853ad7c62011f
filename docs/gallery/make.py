"""Make the gallery again: `python docs/gallery/make.py [--only NAME ...]`, in the project's root."""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path

from gallery_page import PAGE, compress, contact_sheet, page, shown
from gallery_table import HERE, ROOT, Entry, read_table
from orbiflow.cli.app import run


def make(entry: Entry) -> None:
    """Run an entry's commands and keep their pictures."""
    for words in entry.commands():
        print(shown(words), flush=True)
        if run(words):
            sys.exit(f"no picture of {entry.name}")
    compress(ROOT / entry.made, entry)
    if entry.svg:
        shutil.copy(Path(entry.made).with_suffix(".svg"), entry.picture.with_suffix(".svg"))


def main() -> None:
    """Make the pictures (all, or those that are named), the contact sheet and the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", metavar="NAME", help="make these pictures alone")
    parser.add_argument("--page", action="store_true", help="the contact sheet and the page alone")
    options = parser.parse_args()
    entries = read_table()
    names = [entry.name for entry in entries]
    if unknown := set(options.only or ()) - set(names):
        sys.exit(f"no {', '.join(sorted(unknown))} in the gallery; there are {', '.join(names)}")
    os.chdir(ROOT)
    if not options.page:
        for entry in entries:
            if not options.only or entry.name in options.only:
                make(entry)
    if missing := [entry.name for entry in entries if not entry.picture.is_file()]:
        sys.exit(f"no picture yet of {', '.join(missing)}: make them, too")
    contact_sheet(entries)
    PAGE.write_text(page(entries), encoding="utf-8")
    size = sum(file.stat().st_size for file in HERE.rglob("*") if file.is_file())
    print(f"{PAGE}: {len(entries)} tilings, {size / 1e6:.1f} MB in all")


if __name__ == "__main__":
    main()
