"""Settings classes: typed, frozen, checked once, the same from Python, JSON and the command line.

**To write a settings class**, derive from `Settings` and give each field a type, a default and one
sentence, in a string under it::

    class SampleSettings(Settings, group="Samples"):
        count: Annotated[int, Range(1, 1_000_000), Option("-n")] = 1000
        \"\"\"How many samples are drawn.\"\"\"

        kerf: Annotated[LengthOrZero, OnlyWith(cut="pieces"), Group("Pieces")] = 0.0
        \"\"\"Width that the tool burns away.\"\"\"

The class becomes a frozen dataclass whose fields are keywords. A field without default is required.
Types are those of `kinds.py` and `units.py`: `bool`, `int`, `float`, `str`, `Path`,
`Literal`, tuples, unions with None, `Length`, `PageSize`, ...; `Annotated` adds:

- `Range(1, 100)`, `Range(above=0)`, `Unit("s")`: which numbers, in which unit.
- `Option("-n", "--count", off="--no-count")`: what the command line calls the field, where that is
  not just `--field-name`. `Repeated()`: a tuple given by repeating the option. `Hidden()`: no option.
  `Positional()`: an argument that may be left out.
- `Group("Pieces")`: its heading in the help. `DefaultText("one per core")`: what None means.
- `OnlyWith(cut="pieces")`, `Needs("emphasis")`, `NotWith("parts")`: rules about other fields. They
  apply to fields that were given (`settings.fields_given`), so a default never offends.
  `because=...` adds a reason to the message, with names of fields in braces.
- `Ending(".png", ".svg")`: what the name of a file must end in.
- `Parsed(function, "a length such as 40mm")`: text is read by a function; see `kinds.py`.

What rules cannot say goes into a method `check`, which raises a `SettingError` with the names of
fields in braces. A default that depends on other fields goes into a method `defaults`, which returns
values for fields that were not given; so a preset is a field like any other.

Use `settings.replace(...)`, not `dataclasses.replace`, to change fields: it remembers which were given.

**To add an operation**, see `orbiflow.runtime.operations`. **To add an option** to one: add a field to
its settings class, and use it. The command line, JSON, JSON Schema and reference page follow.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, cast, dataclass_transform

from orbiflow.errors import SettingError, literal
from orbiflow.settings.arguments import Range, described, meant, one_of, placeholder, refusal
from orbiflow.settings.kinds import FlagKind, Kind, OptionalKind, RefusedValue, kind_of

Count = Annotated[int, Range(1)]
"""A whole number of things."""

Seed = Annotated[int, Range(0, 2**32 - 1)]
"""A seed of random numbers."""


class Option:
    """What the command line calls a field.

    Args:
        names: Names such as "-n" or "--for". Without a long one, `--field-name` is added.
        off: The name that sets a flag to false, such as "--whole". Default: none for a flag that is
            false anyway, `--no-field-name` for others.
    """

    def __init__(self, *names: str, off: str = "") -> None:
        self.names, self.off = names, off


@dataclass(frozen=True)
class HelpHeading:
    """The heading in the help under which a field stands."""

    name: str


@dataclass(frozen=True)
class Hidden:
    """A field that Python and JSON can set, and the command line cannot."""


@dataclass(frozen=True)
class Positional:
    """A parameter with a default that the command line takes as an argument rather than an option."""


@dataclass(frozen=True)
class DefaultText:
    """What None means, in a few words, such as "one per core"."""

    text: str


class Rule:
    """A rule about a field; as a string, what it needs, for the help."""

    because: str = ""

    def check(self, name: str, values: Mapping[str, Any]) -> None:
        """Raise a `SettingError` where the field that has this name must not be given."""
        raise NotImplementedError

    def __str__(self) -> str:
        return ""

    @property
    def reason(self) -> str:
        return f" ({self.because})" if self.because else ""


class OnlyWith(Rule):
    """A field that applies only where other fields have one of these values.

    A value may be a tuple of several; `because` is a reason, for the message.
    """

    def __init__(self, *, because: str = "", **others: Any) -> None:
        self.others: dict[str, tuple[Any, ...]] = {
            name: value if isinstance(value, tuple) else (value,) for name, value in others.items()
        }
        self.because = because

    def check(self, name: str, values: Mapping[str, Any]) -> None:
        for other, allowed in self.others.items():
            value = values[other]
            if value in allowed:
                continue
            here = "" if isinstance(value, bool) else f", not to {literal(_word(value))}"
            raise SettingError(
                f"{{{name}}} applies only to {_condition(other, allowed)}{here}"
                f"{self.reason}; leave {{{name}}} out or change {{{other}}}"
            )

    def __str__(self) -> str:
        return " and ".join(_condition(*other) for other in self.others.items())


@dataclass(frozen=True)
class Needs(Rule):
    """A field that applies only where another is given, too."""

    other: str
    because: str = ""

    def check(self, name: str, values: Mapping[str, Any]) -> None:
        if not values[self.other]:
            raise SettingError(
                f"{{{name}}} needs {{{self.other}}}{self.reason}; give both or neither"
            )

    def __str__(self) -> str:
        return f"{{{self.other}}}"


class NotWith(Rule):
    """A field that excludes others."""

    def __init__(self, *others: str, because: str = "") -> None:
        self.others = others
        self.because = because

    def check(self, name: str, values: Mapping[str, Any]) -> None:
        for other in self.others:
            if values[other] not in (None, False, ()):
                raise SettingError(
                    f"{{{name}}} and {{{other}}} exclude each other{self.reason}; give one of them"
                )


class Ending(Rule):
    """The endings that the name of a file may have."""

    def __init__(self, *endings: str) -> None:
        self.endings = endings

    def check(self, name: str, values: Mapping[str, Any]) -> None:
        file: Path = values[name]
        if file.suffix.lower() not in self.endings:
            endings = one_of(list(filter(None, self.endings)))
            raise refusal(name, f"a file that ends in {endings}", file.name)


@dataclass(frozen=True)
class Field:
    """A setting of a class, or a parameter of an operation: all that is known of it.

    - `name`: The name in Python and JSON.
    - `annotation`: The type as written.
    - `default`: The default, or `dataclasses.MISSING` if it is required.
    - `doc`: Its sentence.
    - `class_group`: The heading in the help of its class, "" for the command's own.
    - `positional`: Whether the command line takes it as an argument rather than an option.
    """

    name: str
    annotation: Any
    default: Any = MISSING
    find_doc: Callable[[], str] = field(default=str, compare=False)
    class_group: str = ""
    positional: bool = False

    @cached_property
    def group(self) -> str:
        """Its heading in the help."""
        heading = self.of_class(HelpHeading)
        return self.class_group if heading is None else heading.name

    @cached_property
    def kind(self) -> Kind:
        """What values it may have."""
        return kind_of(self.annotation)

    @cached_property
    def doc(self) -> str:
        """Its sentence."""
        return " ".join(self.find_doc().split())

    @property
    def required(self) -> bool:
        """Whether it has no default."""
        return self.default is MISSING

    def missing(self) -> SettingError:
        """Return the error if it is required and not given."""
        what, doc = self.kind.wanted, self.doc.rstrip(".")
        if doc:
            what = doc[0].lower() + doc[1:] if what == "text" else f"{what}: {doc}"
        return SettingError(f"{{{self.name}}} is missing; give {literal(what)}")

    @cached_property
    def metadata(self) -> tuple[Any, ...]:
        """What `Annotated` adds to its type."""
        is_annotated = typing.get_origin(self.annotation) is typing.Annotated
        return typing.get_args(self.annotation)[1:] if is_annotated else ()

    def is_of(self, kind: type[Kind]) -> bool:
        """Return whether its values are of a kind, None apart."""
        inner = self.kind.inner if isinstance(self.kind, OptionalKind) else self.kind
        return isinstance(inner, kind)

    @property
    def rules(self) -> tuple[Rule, ...]:
        """Its rules about other fields."""
        return tuple(entry for entry in self.metadata if isinstance(entry, Rule))

    @cached_property
    def option(self) -> Option:
        """What the command line calls it, always with a long name."""
        option, spelled = self.of_class(Option) or Option(), self.name.replace("_", "-")
        long = any(name.startswith("--") for name in option.names)
        has_off = self.is_of(FlagKind) and self.default is not False
        return Option(
            *(option.names if long else (f"--{spelled}", *option.names)),
            off=option.off or (f"--no-{spelled}" if has_off else ""),
        )

    @property
    def default_text(self) -> str:
        """The default in words, "" for none and for flags."""
        if (stated := self.of_class(DefaultText)) is not None:
            return stated.text
        if self.required or self.default is None or self.default is False or self.default == ():
            return ""
        return f"{_word(self.kind.plain(self.default))} {self.kind.unit}".strip()

    def of_class(self, kind: type[Any]) -> Any:
        """Return the first entry of its metadata that is of a class, or None."""
        return next((entry for entry in self.metadata if isinstance(entry, kind)), None)

    def read(self, value: Any, *, text: bool = False) -> Any:
        """Return a value as it will be used, or raise a `SettingError`.

        With `text`, it comes from the command line.
        """
        return self._read(lambda word: self.kind.read(word, text=text), value)

    def finish(self, value: Any, values: Mapping[str, Any]) -> Any:
        """Return the value of a text that could not be read without another field."""
        if not isinstance(value, str):
            return value
        return self._read(lambda text: self.kind.finish(text, values[self.kind.needs]), value)

    def _read(self, take: Callable[[Any], Any], value: Any) -> Any:
        try:
            return take(value)
        except RefusedValue as error:
            if error.reason:
                raise SettingError(f"{placeholder(self.name)}: {literal(error.reason)}") from error
            wanted = error.wanted or self.kind.wanted
            raise refusal(self.name, wanted, value, error.hint) from None

    def parse(self, words: Sequence[str]) -> Any:
        """Return the value that the command line gives in one word, or several if it is repeated."""
        parts = [self.read(word, text=True) for word in words]
        return tuple(entry for part in parts for entry in part) if self.kind.repeated else parts[-1]

    @property
    def schema(self) -> dict[str, Any]:
        """The field as JSON Schema."""
        schema = {**self.kind.schema, "description": self.doc}
        if self.kind.unit:
            schema["x-unit"] = self.kind.unit
        if not self.required:
            schema["default"] = self.kind.plain(self.default)
        return schema


@dataclass_transform(frozen_default=True, kw_only_default=True)
class Settings:
    """Base of all settings classes; see the top of this module.

    Raises:
        SettingError: If a setting is unknown, missing or not allowed.
    """

    default_group: ClassVar[str] = ""
    """The heading in the help of fields without one of their own (of a class)."""
    fields_given: ClassVar[frozenset[str]] = frozenset()
    """The names of the fields that were given, rather than left at their defaults (of an object)."""

    def __init_subclass__(cls, *, group: str = "", **others: Any) -> None:
        super().__init_subclass__(**others)
        taken = [name for name in vars(cls).get("__annotations__", {}) if hasattr(Settings, name)]
        if taken:
            raise TypeError(f"a field of {cls.__name__} cannot be called {taken[0]}")
        cls.default_group = group
        dataclass(frozen=True, kw_only=True)(cls)

    def __new__(cls, *positional: Any, **given: Any) -> Self:
        """Make an object, once its fields are known to exist."""
        if positional:
            raise SettingError(f"{cls.__name__} takes keywords only, got {len(positional)} values")
        check_names(given, fields_of(cls), cls.__name__)
        made = super().__new__(cls)
        object.__setattr__(made, "fields_given", frozenset(given))
        return made

    def __getnewargs_ex__(self) -> tuple[tuple[()], dict[str, Any]]:
        return (), {name: getattr(self, name) for name in self.fields_given}

    def __post_init__(self) -> None:
        entries = {entry.name: entry for entry in fields_of(type(self))}
        chosen = {name: getattr(self, name) for name in entries if name in self.fields_given}
        self._take(chosen, entries)
        self._take({k: v for k, v in self.defaults().items() if k not in chosen}, entries)
        check_rules(entries.values(), vars(self), self.fields_given)
        self.check()

    def _take(self, values: Mapping[str, Any], entries: Mapping[str, Field]) -> None:
        """Read values of fields, and then the texts that need another field."""
        for name, value in values.items():
            object.__setattr__(self, name, entries[name].read(value))
        for name in values:
            if entries[name].kind.needs:
                finished = entries[name].finish(getattr(self, name), vars(self))
                object.__setattr__(self, name, finished)

    def defaults(self) -> Mapping[str, Any]:
        """Return defaults that depend on other fields, for those that were not given."""
        return {}

    def check(self) -> None:
        """Raise a `SettingError`, with names in braces, for what types and rules cannot say."""

    def replace(self, **changes: Any) -> Self:
        """Return a copy with other values of some fields."""
        chosen = {name: getattr(self, name) for name in self.fields_given}
        return type(self)(**{**chosen, **changes})

    def values(self) -> dict[str, Any]:
        """Return all fields as JSON has them, whether given or not."""
        return {f.name: f.kind.plain(getattr(self, f.name)) for f in fields_of(type(self))}

    def to_json(self) -> dict[str, Any]:
        """Return the fields that were given, as JSON has them: keywords of an equal object."""
        return {name: value for name, value in self.values().items() if name in self.fields_given}


class FileSettings(Settings):
    """Settings of a file, whose `format` its ending decides if it is not given."""

    @property
    def _formats(self) -> tuple[str, ...]:
        (format_field,) = (entry for entry in fields_of(type(self)) if entry.name == "format")
        return format_field.kind.choices

    @property
    def usual_format(self) -> str:
        """The format where neither the field nor an ending says one: the first."""
        return self._formats[0]

    @property
    def file_format(self) -> str:
        """The format that is written."""
        return vars(self)["format"] or self.usual_format

    def for_file(self, out: Path | None) -> Self:
        """Return these settings with the format that a file's ending decides, if it fits the field."""
        chosen, formats = vars(self)["format"], self._formats
        ending = out.suffix.lower().lstrip(".") if out else ""
        if chosen is None and ending and ending not in formats:
            raise SettingError(
                f"{{out}} ends in .{literal(ending)}; give {{format}}, or end it in "
                f"{one_of([f'.{name}' for name in formats])}"
            )
        if chosen is not None and ending in formats and chosen != ending:
            raise SettingError(
                f"{{out}} ends in .{ending} but {{format}} is {chosen}; make them the same"
            )
        return self.replace(format=chosen or ending or self.usual_format)


@cache
def fields_of(cls: type[Settings]) -> tuple[Field, ...]:
    """Return the fields of a settings class as they were written, those under a `HelpHeading` last."""
    hints, group = typing.get_type_hints(cls, include_extras=True), cls.default_group
    fields = (
        Field(entry.name, hints[entry.name], entry.default, _doc_finder(cls, entry.name), group)
        for entry in dataclasses.fields(cast(Any, cls))
    )
    return tuple(sorted(fields, key=lambda entry: entry.of_class(HelpHeading) is not None))


def check_names(names: Iterable[str], entries: Iterable[Field], what: str) -> None:
    """Raise a `SettingError` for a name that is not known, or one that is required and missing."""
    fields = {entry.name: entry for entry in entries}
    for name in names:
        if name not in fields:
            hint = literal(meant(name, list(fields)) or f"there are {', '.join(fields)}")
            raise SettingError(f"{literal(what)} has no setting {literal(described(name))}; {hint}")
    for name, entry in fields.items():
        if entry.required and name not in names:
            raise entry.missing()


def check_rules(fields: Iterable[Field], values: Mapping[str, Any], named: Iterable[str]) -> None:
    """Apply the rules of all fields that were given and have an effect, up to one that is broken."""
    for entry in fields:
        value = values[entry.name]
        if entry.name in named and (value or value != entry.default):
            for rule in entry.rules:
                rule.check(entry.name, values)


def _doc_finder(cls: type, name: str) -> Callable[[], str]:
    return lambda: next(filter(None, (_docs(base).get(name, "") for base in cls.__mro__)), "")


@cache
def _docs(cls: type) -> dict[str, str]:
    """Return the strings under the fields of a class, from its source."""
    if cls in (object, Settings):
        return {}
    (definition,) = ast.parse(inspect.cleandoc("\n" + inspect.getsource(cls))).body
    assert isinstance(definition, ast.ClassDef)
    docs: dict[str, str] = {}
    for pair in itertools.pairwise(definition.body):
        match pair:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(
                value=ast.Constant(value=str(text))
            ):
                docs[name] = text
            case _:
                pass
    return docs


def _condition(name: str, allowed: tuple[Any, ...]) -> str:
    """Return what must hold of another field, such as "{cut} none or skeleton"; True needs no word."""
    words = ["none" if value is None else _word(value) for value in allowed if value is not True]
    return f"{{{name}}} {literal(one_of(words))}" if words else f"{{{name}}}"


def _word(value: Any) -> str:
    """Return a value as a user writes it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, list | tuple):
        return ",".join(map(_word, cast(Sequence[Any], value)))
    return "nothing" if value is None else str(value)
