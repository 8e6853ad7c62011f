"""Commands derived from operations: options from settings, events to the terminal."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from functools import cache
from inspect import Parameter as Argument
from inspect import Signature
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, cast

from cyclopts import App, CoercionError, CycloptsError, Group, MissingArgumentError, Parameter
from cyclopts.exceptions import RepeatArgumentError, UnusedCliTokensError
from rich.console import Console
from rich.markup import escape

from orbiflow import __version__
from orbiflow.errors import Advice, OrbiflowError, SettingError, advice_of, literal
from orbiflow.runtime import Cancelled, Operation, Polled, find, use_one_thread
from orbiflow.settings import OPERATIONS, Field, FlagKind, Hidden, ListKind, PathKind, meant

HELP = "Turn a silhouette into a tile that looks like it and provably tiles the plane."
START = (
    "Start with: orbiflow escherize photo-cutout.png --out out/  (then look at out/overview.png)"
)
ARGUMENTS, OPTIONS = Group("Arguments", sort_key=0), Group("Options", sort_key=1)
GROUPS = {
    "density": "Fit, evaluate, sample and draw exact densities of angles, directions and axes."
}
"""Names that several commands begin with, and what they are about."""


def main(words: Sequence[str] | None = None) -> None:
    """Run the command line: exit status 0, 1 (nothing found), 2 (a mistake) or 130 (stopped)."""
    sys.exit(run(sys.argv[1:] if words is None else words))


def run(words: Sequence[str]) -> int:
    """Run a command and return its exit status."""
    try:
        try:
            app = app_for(words)
            _check_values(words, _operation(words))
            status = app(words)
        except CycloptsError as error:
            raise _mistake(error, _operation(words), words) from error
    except OrbiflowError as error:
        text = advice_of(error)
        if isinstance(text, Advice) and (operation := _operation(words)):
            text = text.named(_namer(operation))
        _to_standard_error(f"[bold red]error:[/] {escape(text)}")
        return 2
    except (KeyboardInterrupt, Cancelled):
        _to_standard_error("interrupted")
        return 130
    return status if isinstance(status, int) else 0


def _to_standard_error(text: str) -> None:
    Console(stderr=True, emoji=False).print(text, soft_wrap=True, highlight=False)


def app_for(words: Sequence[str]) -> App:
    """Return the application with the one command that is asked for, or else with a list of all."""
    app = App(
        name="orbiflow",
        help=HELP,
        help_epilogue=START,
        version=f"orbiflow {__version__}",
        version_flags="--version",
        help_flags=["--help", "-h"],
        help_format="plaintext",
        result_action="return_value",
        exit_on_error=False,
        print_error=False,
        suppress_keyboard_interrupt=False,
        default_parameter=Parameter(negative=()),
    )
    for name, text in GROUPS.items():
        app.command(App(name=name, help=text, help_epilogue=""))
    operation = _operation(words)
    whole = operation is not None or "--install-completion" in words  # a list needs no options
    for place, name in enumerate([operation.name] if operation else OPERATIONS):
        *group, command = name.split()
        home = app[group[0]] if group else app
        home.command(
            _command(find(name)) if whole else lambda: None,
            name=command,
            help=None if whole else summary(name),
            help_epilogue="",
            sort_key=place,
            group_arguments=ARGUMENTS,
            group_parameters=OPTIONS,
        )
    if operation is None:
        app.register_install_completion_command()  # pyright: ignore[reportUnknownMemberType]
    return app


def summary(name: str) -> str:
    """Return the first sentence of an operation's docstring from its source, which is not imported."""
    module, function = OPERATIONS[name].split(":")
    return " ".join(_docstrings(module)[function].partition("\n\n")[0].split())


@cache
def _docstrings(module: str) -> dict[str, str]:
    file = Path(__file__).parents[1].joinpath(*module.split(".")[1:]).with_suffix(".py")
    functions = [n for n in ast.parse(file.read_bytes()).body if isinstance(n, ast.FunctionDef)]
    return {node.name: ast.get_docstring(node) or "" for node in functions}


def _operation(words: Sequence[str]) -> Operation | None:
    plain = [word for word in words if word[:1] != "-"]
    names = (" ".join(plain[:count]) for count in (1, 2))
    return next((find(name) for name in names if name in OPERATIONS), None)


def _command(operation: Operation) -> Callable[..., int]:
    """Return a function whose signature is the command line of an operation."""
    fields = {entry.name: entry for entry in operation.fields if not entry.of_class(Hidden)}

    def command(*words: Any, **options: Any) -> int:
        bound = signature.bind(*words, **options).arguments.items()
        values = {name: _value(fields[name], word) for name, word in bound if word is not None}
        return _do(operation, values)

    named = _namer(operation)
    headings = dict.fromkeys(entry.group for entry in fields.values() if entry.group)
    groups = {name: Group(name, sort_key=2 + k) for k, name in enumerate(headings)}
    arguments = [_argument(entry, groups, named) for entry in fields.values()]
    # arguments go before options, and what is required before what is not
    arguments.sort(key=lambda argument: (argument.kind, argument.default is not Argument.empty))
    paragraphs = operation.doc.split("\n\n")
    command.__doc__ = "\n\n".join(" ".join(text.split()) for text in paragraphs)
    command.__name__ = operation.name.split()[-1]
    command.__signature__ = signature = Signature(arguments)  # pyright: ignore[reportFunctionMemberAccess]
    return command


def _argument(entry: Field, groups: dict[str, Group], named: Callable[[str], str]) -> Argument:
    parameter = Parameter(
        name=entry.name.upper() if entry.positional else entry.option.names,
        help=_help(entry, named),
        group=ARGUMENTS if entry.positional else groups.get(entry.group, OPTIONS),
        negative=entry.option.off or (),
        required=entry.required,
        show_default=False,
        allow_leading_hyphen=not entry.positional and not entry.is_of(FlagKind),
        metavar=None
        if entry.is_of(FlagKind)
        else _either(entry.kind.choices) or entry.kind.metavar,
        choices=entry.kind.choices or None,
        show_choices=False,
    )
    return Argument(
        entry.name,
        Argument.POSITIONAL_ONLY if entry.positional else Argument.KEYWORD_ONLY,
        default=Argument.empty if entry.required else None,
        annotation=Annotated[_hint(entry), parameter],
    )


def _either(choices: Sequence[str]) -> str:
    """Return the choices for the help; where a column may be too narrow, spaces let them wrap."""
    joined = "|".join(choices)
    return joined if len(joined) <= 24 else " | ".join(choices)


def _hint(entry: Field) -> Any:
    """Return what cyclopts takes: words, which the field then reads."""
    if entry.is_of(FlagKind):
        hint: Any = bool
    else:
        hint = Path if entry.is_of(PathKind) else str
        if entry.kind.repeated or (entry.positional and isinstance(entry.kind, ListKind)):
            hint = list[hint]
    return hint if entry.required else hint | None


def _value(entry: Field, word: Any) -> Any:
    if isinstance(word, bool):
        return word
    words = cast(list[Any], word) if isinstance(word, list) else [word]
    return entry.parse(list(map(str, words)))


def _help(entry: Field, named: Callable[[str], str]) -> str:
    """Return the field's sentence, then range, default and rules in brackets."""
    rules = [SettingError(str(rule)).named(named) for rule in entry.rules if str(rule)]
    notes = {
        "": entry.kind.limits,
        "default: ": entry.default_text,
        "only with ": " and ".join(rules),
    }
    remarks = "; ".join(word + note for word, note in notes.items() if note)
    return f"{entry.doc} [{remarks}]" if remarks else entry.doc


def _namer(operation: Operation) -> Callable[[str], str]:
    """Return what the command line calls each setting of an operation."""
    fields = {entry.name: entry for entry in operation.fields}

    def named(name: str) -> str:
        if name not in fields or fields[name].of_class(Hidden):
            return name
        return name.upper() if fields[name].positional else fields[name].option.names[0]

    return named


def _do(operation: Operation, values: dict[str, Any]) -> int:
    """Run an operation on the terminal and return the exit status."""
    call = operation.call(values)

    from orbiflow.cli.terminal import Terminal, stopped_by_signals

    use_one_thread()
    with Terminal(_namer(operation)) as terminal:
        cancel = Polled(terminal.watch)
        # only what keeps a part has something to stop for
        with stopped_by_signals(cancel) if operation.keeps_partial else nullcontext():
            return call.run(terminal, cancel).exit_status


def _mistake(
    error: CycloptsError, operation: Operation | None, words: Sequence[str]
) -> OrbiflowError:
    """Return what is wrong with a command line, in the words of settings."""
    fields = {entry.name: entry for entry in operation.fields} if operation else {}
    named = error.argument.field_info.name if error.argument else ""
    if isinstance(error, RepeatArgumentError):
        return _repeated(error.token.keyword or "", words, fields.values())
    if isinstance(error, UnusedCliTokensError):
        words = ", ".join(map(repr, error.unused_tokens or ()))
        return OrbiflowError(f"there are arguments too many: {words}; see --help")
    if isinstance(error, MissingArgumentError) and (unknown := _unknown(words, fields.values())):
        return unknown  # what is missing may be what was misspelt
    if isinstance(error, MissingArgumentError) and named in fields:
        if error.keyword:
            return _needs_value(fields[named])
        return fields[named].missing()
    if isinstance(error, CoercionError) and error.token and named in fields:
        try:
            fields[named].parse([error.token.value])
        except SettingError as own:
            return own
    error.verbose = False
    return OrbiflowError(" ".join(str(error).split()))


def _check_values(words: Sequence[str], operation: Operation | None) -> None:
    """Refuse an option whose value is missing, so that the next option would be taken for it."""
    fields = operation.fields if operation else ()
    names = {name for field in fields for name in (*field.option.names, field.option.off)}
    valued = {name: field for field in fields for name in field.option.names}
    for word, after in pairwise(words):
        if after in names and word in valued and not valued[word].is_of(FlagKind):
            raise _needs_value(valued[word])


def _needs_value(field: Field) -> SettingError:
    return SettingError(f"{{{field.name}}} needs a value; give {literal(field.kind.wanted)}")


def _repeated(word: str, words: Sequence[str], fields: Iterable[Field]) -> OrbiflowError:
    """Return what is wrong where an option is given again, or a flag both ways."""
    for option in (field.option for field in fields):
        repeats = dict.fromkeys(w for w in words if w in (*option.names, option.off))
        if word in repeats and option.off in repeats and len(repeats) > 1:
            return OrbiflowError(f"{' and '.join(repeats)} exclude each other; give one of them")
    return OrbiflowError(f"{word} is given more than once; give it once")


def _unknown(words: Sequence[str], fields: Iterable[Field]) -> OrbiflowError | None:
    """Return what is wrong with the first unknown option, if there is one."""
    names = [name for field in fields for name in (*field.option.names, field.option.off) if name]
    for word in words:
        option = word.split("=")[0]
        if option[:2] == "--" and option[2:3].isalpha() and option not in names:
            hint = meant(option, names) or "see --help"
            return OrbiflowError(f"unknown option {option}; {hint}")
    return None
