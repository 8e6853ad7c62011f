"""Settings classes: the same from Python, JSON and the command line, and every bound kept."""

import copy
import json
import math
import pickle
from pathlib import Path
from typing import Annotated, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from orbiflow.drawing import PALETTES
from orbiflow.errors import SettingError
from orbiflow.runtime import find
from orbiflow.settings import (
    OPERATIONS,
    Colour,
    DefaultText,
    Field,
    FlagKind,
    HelpHeading,
    Length,
    LengthOrZero,
    ListKind,
    Needs,
    NotWith,
    OnlyWith,
    Option,
    PageSize,
    PathKind,
    Range,
    Repeated,
    Settings,
    Unit,
    fields_of,
)
from orbiflow.settings.kinds import (
    ChoiceKind,
    Kind,
    NumberKind,
    OptionalKind,
    ParsedKind,
    RefusedValue,
    TupleKind,
)
from refusals import refused
from strategies import names_in


class Sheet(Settings, group="Sheet"):
    """A sheet, for tests."""

    cut: Literal["none", "skeleton", "pieces"] = "none"
    """What is drawn."""

    size: Length = 40.0
    """Longer side."""

    kerf: Annotated[
        LengthOrZero, OnlyWith(cut="pieces", because="lines are cut once"), HelpHeading("Cut")
    ] = 0.0
    """Width that the tool
    burns away."""

    page: PageSize | None = None
    bed: PageSize | None = None
    ink: Colour = "#000000"
    copies: Annotated[int | None, Range(1, 99), Option("-n"), DefaultText("many")] = None
    share: Annotated[float, Range(above=0, below=1)] = 0.5
    seconds: Annotated[float | None, Range(0), Unit("s")] = None
    mask: Path | None = None
    strength: Annotated[float | None, Needs("mask")] = None
    names: tuple[str, ...] | None = None
    pins: Annotated[tuple[str, ...], Repeated()] = ()
    middle: tuple[float, float] | None = None
    clip: Annotated[bool, Option(off="--whole"), NotWith("pins")] = False
    border: Annotated[bool, OnlyWith(clip=True)] = False
    width: Annotated[float, Range(1, 9)] | None = None


class Point(Settings):
    """A required setting, for tests."""

    x: Annotated[int, Range(0, 9)]
    y: int = 0


FIELDS = {entry.name: entry for entry in fields_of(Sheet)}
EVERY_FIELD = {
    f"{operation.name}: {entry.name}": entry
    for operation in list(map(find, OPERATIONS))
    for entry in operation.fields
} | FIELDS
WORD = st.text("abcxyz{}0 ", min_size=1).map(str.strip).filter(bool)


def values_of(kind: Kind) -> st.SearchStrategy[Any]:
    """Values that a kind takes, as Python has them."""
    match kind:
        case NumberKind(allowed=allowed, whole=whole):
            low = allowed.least if allowed.least is not None else allowed.above
            high = allowed.most if allowed.most is not None else allowed.below
            if whole:
                return st.integers(*(None if end is None else int(end) for end in (low, high)))
            numbers = st.floats(low, high, allow_nan=False, allow_infinity=False)
            return numbers.filter(lambda number: number in allowed)
        case ChoiceKind(choices=choices):
            return st.sampled_from(choices)
        case ListKind(item=item):
            return st.lists(values_of(item), min_size=1, max_size=3).map(tuple)
        case TupleKind(items=items):
            return st.tuples(*map(values_of, items))
        case OptionalKind(inner=inner):
            return st.none() | values_of(inner)
        case ParsedKind(inner=inner):
            if kind.metavar == "COLOUR":
                return st.integers(0, 0xFFFFFF).map(lambda number: f"#{number:06x}")
            if kind.metavar == "PALETTE":
                return st.sampled_from(list(PALETTES))
            return values_of(inner)
        case PathKind():
            return WORD.map(Path)
        case FlagKind():
            return st.booleans()
        case _:
            return WORD


def one_field() -> st.SearchStrategy[tuple[Field, Any]]:
    return st.sampled_from(list(EVERY_FIELD.values())).flatmap(
        lambda entry: st.tuples(st.just(entry), values_of(entry.kind))
    )


@given(one_field())
def test_a_value_survives_json(drawn: tuple[Field, Any]) -> None:
    entry, value = drawn
    if isinstance(value, str) and not isinstance(entry.kind, ChoiceKind):
        value = entry.read(value)
    plain = json.loads(json.dumps(entry.kind.plain(entry.read(value)), allow_nan=False))
    assert entry.read(plain) == entry.read(value) == value


def _made(values: dict[str, Any]) -> Sheet | str:
    try:
        return Sheet(**values)
    except SettingError as error:
        return str(error)


@given(st.data())
def test_python_json_and_command_line_agree(data: st.DataObject) -> None:
    names = data.draw(st.sets(st.sampled_from(sorted(FIELDS))))
    given_values = {name: data.draw(values_of(FIELDS[name].kind)) for name in names}
    plain = {name: FIELDS[name].kind.plain(value) for name, value in given_values.items()}
    made, again = _made(given_values), _made(plain)
    if not isinstance(made, Sheet):
        assert made == again  # refused in the same words
        return
    assert made == again
    assert made.fields_given == names
    assert Sheet(**json.loads(json.dumps(made.to_json()))) == made
    assert pickle.loads(pickle.dumps(made)).fields_given == names
    assert copy.copy(made) == made == made.replace()
    assert made.replace().fields_given == names


@pytest.mark.parametrize("name", EVERY_FIELD)
def test_defaults_are_allowed(name: str) -> None:
    entry = EVERY_FIELD[name]
    if not entry.required and entry.default != ():
        assert entry.read(entry.default) == entry.default


def number_kinds() -> dict[str, tuple[Field, NumberKind]]:
    found: dict[str, tuple[Field, NumberKind]] = {}
    for name, entry in EVERY_FIELD.items():
        kind = entry.kind
        while isinstance(kind, OptionalKind | ParsedKind):
            kind = kind.inner
        if isinstance(kind, NumberKind):
            found[name] = entry, kind
    return found


def read_whole(entry: Field, value: Any) -> Any:
    """Read a value, and finish it if the field needs another."""
    known = entry.read(value)
    return entry.finish(known, {entry.kind.needs: 300.0}) if entry.kind.needs else known


@pytest.mark.parametrize("name", number_kinds())
def test_bounds_of_every_number(name: str) -> None:
    entry, kind = number_kinds()[name]
    bounds, step = kind.allowed, 1 if kind.whole else 1e-6
    wrong: list[Any] = [math.nan, math.inf, -math.inf, True, "many", [1], 1j]
    for bound, sign in ((bounds.least, -1), (bounds.most, 1)):
        if bound is not None:
            inside = int(bound) if kind.whole else bound
            assert entry.read(inside) == inside
            wrong.append(inside + sign * max(step, abs(inside) * step))
    wrong += [bound for bound in (bounds.above, bounds.below) if bound is not None]
    for value in wrong:
        with pytest.raises(SettingError) as error:
            read_whole(entry, value)
        assert entry.name in names_in(error.value)


MISTAKES: dict[str, tuple[dict[str, Any], tuple[str, ...], tuple[object, ...]]] = {
    "unknown": ({"cutt": "none"}, (), ("cutt", "cut")),
    "choice": ({"cut": "piece"}, ("cut",), ("piece", "pieces")),
    "choice of another type": ({"cut": 3}, ("cut",), ("none", "skeleton", "pieces", 3)),
    "no unit": ({"size": "40"}, ("size",), ("40", "40mm", "40cm")),
    "unit": ({"size": "40ft"}, ("size",), ("40ft",)),
    "zero": ({"size": 0}, ("size",), (0,)),
    "colour": ({"ink": "red"}, ("ink",), ("red",)),
    "size": ({"bed": (1, 2, 3)}, ("bed",), ("300x200mm",)),
    "side": ({"bed": (1, 0)}, ("bed",), (2, 0)),
    "braces": ({"cut": "{size}"}, ("cut",), ("{size}",)),
    "fraction": ({"copies": 1.0}, ("copies",), (1.0,)),
    "text for a list": ({"names": "a,b"}, ("names",), ("a,b",)),
    "empty list": ({"names": ()}, ("names",), ()),
    "entry": ({"names": (1,)}, ("names",), (1,)),
    "path": ({"mask": ""}, ("mask",), ()),
    "only with": ({"kerf": 1.0}, ("kerf", "cut", "kerf", "cut"), ("pieces",)),
    "only with a flag": ({"border": True}, ("border", "clip", "border", "clip"), ()),
    "needs": ({"strength": 1.0}, ("strength", "mask"), ()),
    "not with": ({"clip": True, "pins": ("a",)}, ("clip", "pins"), ()),
}


@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_name_the_setting_and_the_value(name: str) -> None:
    values, names, about = MISTAKES[name]
    with refused(*about, kind=SettingError) as error:
        Sheet(**values)
    assert names_in(error.value) == names
    assert all("--" + field in error.value.named(lambda field: "--" + field) for field in names)


def test_rules_are_about_what_was_given() -> None:
    assert Sheet(kerf=0.0).kerf == 0  # no effect, no offence
    assert Sheet(cut="pieces", kerf="1.5mm").kerf == 1.5  # pyright: ignore[reportArgumentType]
    with refused("kerf", kind=SettingError):
        Sheet(cut="pieces", kerf=1.0).replace(cut="none")


def test_settings_are_frozen_and_hashable_and_a_required_one_is_missed_by_name() -> None:
    made = Sheet(names=("a",))
    with pytest.raises(AttributeError):
        made.cut = "none"  # pyright: ignore[reportAttributeAccessIssue]
    assert hash(made) == hash(Sheet(names=("a",)))
    with pytest.raises(SettingError) as error:
        Point(y=1)  # pyright: ignore[reportCallIssue]
    assert names_in(error.value) == ("x",)


def test_what_fields_say_of_themselves() -> None:
    kerf, copies, clip = FIELDS["kerf"], FIELDS["copies"], FIELDS["clip"]
    assert (kerf.doc, kerf.group) == ("Width that the tool burns away.", "Cut")
    assert FIELDS["size"].group == "Sheet"
    assert (kerf.kind.unit, kerf.default_text) == ("mm", "0 mm")
    assert (copies.option.names, copies.default_text) == (("--copies", "-n"), "many")
    assert (clip.option.off, clip.default_text) == ("--whole", "")
    # those under a heading of their own come last
    assert (list(FIELDS)[:2], list(FIELDS)[-2:]) == (["cut", "size"], ["width", "kerf"])
    # tuples from the command line
    assert FIELDS["names"].parse(["a, b"]) == ("a", "b")
    assert FIELDS["pins"].parse(["1,2", "3,4"]) == ("1,2", "3,4")
    assert FIELDS["middle"].parse(["1,-2"]) == (1.0, -2.0)
    assert FIELDS["width"].parse(["3"]) == 3.0


def test_a_field_cannot_hide_a_method_and_a_kind_raises_no_setting_error() -> None:
    with refused("replace", kind=TypeError):
        type("Wrong", (Settings,), {"__annotations__": {"replace": int}, "replace": 1})
    with pytest.raises(RefusedValue):
        FIELDS["size"].kind.read("40")
