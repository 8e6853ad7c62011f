"""Running a notebook's cells without Jupyter, and keeping what they show.

`python tests/notebooks.py docs/quickstart.ipynb` runs it anew and stores the outputs in it.
"""

import ast
import base64
import contextlib
import io
import os
import sys
from pathlib import Path
from typing import Any

import nbformat


def run(path: Path, folder: Path) -> Any:
    """The notebook with the outputs of this run; its cells' working directory is `folder`.

    What Jupyter does with plain cells: they share one namespace, and the value of a last expression
    is shown, as a picture if it has one. Raises what a cell raises.
    """
    book = nbformat.read(path, as_version=4)
    names: dict[str, object] = {"__name__": "__main__"}
    with contextlib.chdir(folder):
        for count, cell in enumerate((c for c in book.cells if c.cell_type == "code"), 1):
            cell.execution_count = count
            cell.outputs = _outputs(cell.source, names, f"{path.name}, cell {count}")
    return book


def _outputs(source: str, names: dict[str, object], where: str) -> list[Any]:
    tree = ast.parse(source, where)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with contextlib.redirect_stdout(printed):
        exec(compile(tree, where, "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), where, "eval"), names)
    found = []
    if printed.getvalue():
        found.append(nbformat.v4.new_output("stream", name="stdout", text=printed.getvalue()))
    if value is not None:
        found.append(nbformat.v4.new_output("display_data", data=_shown(value)))
    return found


def _shown(value: object) -> dict[str, str]:
    picture = getattr(value, "_repr_png_", None)
    if picture is None:
        return {"text/plain": repr(value)}
    png = picture()
    text = f"<{type(value).__name__}>"
    return {"image/png": base64.b64encode(png).decode(), "text/plain": text}


if __name__ == "__main__":
    book_path = Path(sys.argv[1]).resolve()
    done = run(book_path, book_path.parent)
    nbformat.validate(done)
    book_path.write_text(nbformat.writes(done) + os.linesep, encoding="utf-8")
