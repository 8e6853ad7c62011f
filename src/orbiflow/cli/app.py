"""`orbiflow`: the commands, and what happens when one fails."""

from __future__ import annotations

import sys
from typing import Annotated

import typer
from rich.markup import escape

from orbiflow import __version__
from orbiflow.cli import commands
from orbiflow.cli.batch import batch
from orbiflow.cli.console import errors
from orbiflow.cli.density import density
from orbiflow.errors import OrbiflowError
from orbiflow.jobs import RecordError

app = typer.Typer(
    name="orbiflow",
    help="Turn a silhouette into a tile that looks like it and provably tiles the plane.",
    epilog="Start with: orbiflow escherize photo-cutout.png --out out/  "
    "(then look at out/overview.png)",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command()(batch)
app.add_typer(density)


@app.callback(invoke_without_command=True)
def _global(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and stop.")] = False,
) -> None:
    if version:
        typer.echo(f"orbiflow {__version__}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _option(field: str) -> str:
    """What a field of a request is called here."""
    return {"count": "-n", "models": "--model"}.get(field, "--" + field.replace("_", "-"))


def main() -> None:
    """Run the command line: exit status 0, 1 (no tile found), 2 (a user's mistake) or 130 (Ctrl-C)."""
    if not sys.argv[2:] and sys.argv[1:2] in ([], ["--help"], ["-h"]):
        commands.main()
    if sys.argv[1:2] in ([name] for name in ("escherize", "export", "art", "animate", "classes")):
        commands.main()
    try:
        app()
    except OrbiflowError as error:
        text = error.named(_option) if isinstance(error, RecordError) else str(error)
        errors.print(f"[bold red]error:[/] {escape(text)}", soft_wrap=True, highlight=False)
        sys.exit(2)
    except KeyboardInterrupt:
        errors.print("interrupted")
        sys.exit(130)
