"""Names of space groups as people typeset them, found among the settings that gemmi lists."""

import html
import re
from collections.abc import Sequence
from functools import lru_cache
from itertools import product
from typing import Any, NamedTuple

MAX_LENGTH = 200
USUAL = 530  # so many of gemmi's settings, its first, are in International Tables
HALL = re.compile(
    r"-?[PABCIRSTF](?: ?-?[1-6](?:[xyz'\"*=]|[abcnuvwd1-5])*)+(?: ?\( ?-?\d+ -?\d+ -?\d+ ?\))?"
)
"""Symbols of Hall: a lattice, then rotations with their axes and shifts, and a change of origin."""

_AXES_OF_HALL = re.compile(r"[xyz'\"*=]")  # letters of no other symbol
_SHIFTS_OF_HALL = re.compile(r"\d[abcnuvwd]|-2")
_NUMBERED = re.compile(
    r"(?:(?:no\.?|number|\#)\s*)?0*([1-9]\d{0,2})(?:\.0*)?(?:\s*:\s*(\w[\w-]*|-\w+))?",
    re.IGNORECASE,
)
_MINUS = "\u2010\u2011\u2012\u2013\u2014\u2212\ufe63\uff0d"
_SUBSCRIPTS = {0x2080 + n: f"_{n}" for n in range(10)}
_PLAIN = str.maketrans({**dict.fromkeys(_MINUS, "-"), "\u2044": "/", "\u2215": "/", "\u00a0": " "})
_TYPESETTING: tuple[tuple[str, str], ...] = (
    (r"<sub>\s*(\d)\s*</sub>", r"_\1"),
    (r"<(\w+)[^<>]*overline[^<>]*>\s*(\d)\s*</\1>", r"-\2"),
    (r"</?[A-Za-z][^<>]*>", ""),
    (r"\\(?:bar|overline)\s*(?:\{\s*(\d)\s*\}|(\d))", r"-\1\2"),
    (r"bar\s*(\d)", r"-\1"),
    (r"(\d)bar(?!\s*\d)", r"-\1"),
    (r"\\(?:mathrm|mathit|mathbf|mathsf|text|textit|textrm|rm|it)\b\s*", ""),
    (r"~(\d)~", r"_\1"),
    (r"\\[,;:! ]|~", " "),
    (r"_\s*\{\s*(\d)\s*\}", r"_\1"),
    (r"[{}$]", ""),
    (r"(\d)[\u0304\u0305]", r"-\1"),
    (r"[\u00af\u203e]\s*(?=\d)", "-"),
    (r"(\d)[\u00af\u203e]", r"-\1"),
    (r"(?<=\d)\s*[(\[](\d)[)\]]", r"_\1"),
    (r"\s*/\s*", "/"),
)
_EXTENSION = re.compile(
    r"\s*:\s*([12HRSZ]|-?[abc][a-c1-6-]*)$|\s+([HR])$|\s*([SZ])$", re.IGNORECASE
)
_ABBREVIATED = {"mmm", "4/mmm", "-3m", "6/mmm", "m-3", "m-3m"}
"""Point groups whose short symbols leave out the axes across their mirrors."""

_ORIGINS = {"S": "1", "Z": "2"}  # as the ICSD writes them
_AFTER_2002 = {
    **{"A e m 2": "A b m 2", "A e a 2": "A b a 2"},
    **{"C m c e": "C m c a", "C m m e": "C m m a", "C c c e": "C c c a"},
}


class _Symbol(NamedTuple):
    """The parts of a way to write a setting, in small letters, and whether tables of groups have it."""

    parts: tuple[str, ...]
    is_usual: bool
    setting: Any


def plain(name: str) -> str:
    """Return a typeset name in plain letters: subscripts after "_", a bar as a minus before its digit.

    >>> plain(r"$P2_{1}/c$"), plain("P2(1)/c"), plain("P2\u2081/c"), plain("P1\u0305")
    ('P2_1/c', 'P2_1/c', 'P2_1/c', 'P-1')
    """
    text = html.unescape(name[:MAX_LENGTH]).translate(_SUBSCRIPTS).translate(_PLAIN)
    for pattern, meant in _TYPESETTING:
        text = re.sub(pattern, meant, text)
    return " ".join(text.split())


def find_setting(gemmi: Any, name: str) -> Any | None:
    """Return the row of gemmi's table that a Hermann-Mauguin symbol names, or None.

    It may be short or full ("P n m a", "P 21/n 21/m 21/a"). Blanks may be left out, or stand between
    the symbol's parts; letters may be large or small.
    """
    text = plain(name)
    exact = next((row for row in gemmi.spacegroup_table() if row.xhm() == text), None)
    settings = [exact] if exact is not None else settings_named(gemmi, name)
    # the first listed of several: unique axis b before c and a, hexagonal axes
    return settings[0] if len({setting.number for setting in settings}) == 1 else None


def settings_named(gemmi: Any, name: str) -> list[Any]:
    """Return all rows that a symbol names, those in International Tables if any are: see above."""
    text, extension = _without_extension(plain(name))
    if re.match(r"[A-Za-z]_", text):  # "P_21/c": no axis has a subscript there, so they are blanks
        text = text.replace("_", " ")
    written = [part.lower() for part in re.findall(r"^[A-Za-z]|[^ ]+", text)]
    if not text or not re.fullmatch(r"[A-Za-z][-_/ A-Za-z0-9]*", text):
        return []
    symbols = [
        symbol
        for symbol in _symbols(gemmi).get("".join(written).replace("_", ""), ())
        if _is_written(written, symbol.parts) and _has_extension(symbol.setting, extension)
    ]
    usual = [symbol.setting for symbol in symbols if symbol.is_usual]
    return usual or [symbol.setting for symbol in symbols]


def settings_numbered(gemmi: Any, text: str) -> list[Any]:
    """Return all rows that a number means, such as "62", "No. 225", "#225", "227:2" or "62:cab"."""
    match = _NUMBERED.fullmatch(text.strip())
    if match is None:
        return []
    extension = _plain_extension(match[2] or "")
    return [
        row
        for row in gemmi.spacegroup_table()
        if row.number == int(match[1]) and _has_extension(row, extension)
    ]


def has_two_origins(settings: Sequence[Any]) -> bool:
    """Return whether the first of the settings that a name may mean is among them with both origins."""
    return {"1", "2"} <= {row.ext for row in settings if row.hm == settings[0].hm}


def find_hall(gemmi: Any, name: str) -> list[Any] | None:
    """Return the operators of a symbol of Hall, said by "Hall:" or written like no other; or None."""
    text = " ".join(name.split())
    said = re.fullmatch(r"hall\s*[:=]\s*(.*)", text, re.IGNORECASE)
    text = said[1] if said else text
    if not HALL.fullmatch(text):
        return None
    if not said and not _is_surely_of_hall(gemmi, text):
        return None
    try:
        return list(gemmi.symops_from_hall(text))
    except (RuntimeError, ValueError):
        return None


def _is_surely_of_hall(gemmi: Any, text: str) -> bool:
    """Whether a symbol of Hall is no Hermann-Mauguin symbol in any reading, nor all but one.

    It has letters of axes, or two of these: a leading minus, shifts or an axis -2, several axes.
    "-P 4" may be meant for P -4, and "P 2c" for P 2/c.
    """
    has_minus, has_several = text[0] == "-", text.count(" ") > 1
    signs = (has_minus, bool(_SHIFTS_OF_HALL.search(text)), has_several)
    is_sure = bool(_AXES_OF_HALL.search(text)) or (sum(signs) > 1 and any(signs[:2]))
    is_listed = has_minus or text in {row.hall for row in gemmi.spacegroup_table()}
    return is_sure and is_listed and not settings_named(gemmi, text)


def _without_extension(text: str) -> tuple[str, str]:
    """Return a symbol and the setting after it: an origin, axes, or the cell of a monoclinic group."""
    match = _EXTENSION.search(text)
    if match is None and re.fullmatch(r"R.+[HR]", text, re.IGNORECASE):
        return text[:-1].strip(), text[-1].upper()
    if match is None:
        return text, ""
    return text[: match.start()], _plain_extension(match[1] or match[2] or match[3])


def _plain_extension(given: str) -> str:
    extension = given.upper() if len(given) == 1 and given.upper() in "12HRSZ" else given.lower()
    return _ORIGINS.get(extension, extension)


def _has_extension(setting: Any, extension: str) -> bool:
    ending = setting.ext.strip("\0")
    cell = re.sub(r"^-?([abc])\d?$", r"\1", setting.qualifier)  # of monoclinic settings, the axis
    return extension in ("", ending, setting.qualifier, cell)


def _is_written(written: Sequence[str], parts: Sequence[str]) -> bool:
    """Whether a symbol of these parts is written so: blanks between them, "_" in screw axes."""
    spans, written_spans = _spans(parts), _spans([part.replace("_", "") for part in written])
    letters = "".join(written)
    marks = [at for at, letter in enumerate(letters) if letter == "_"]
    subscripts = {at - count for count, at in enumerate(marks)}
    screws = {start + 1 for (start, _), part in spans.items() if re.match(r"[2346][1-5]", part)}
    # numbers apart are apart in the symbol: "P 2 1" is not P 21, and "P 32 1" not P 3 2 1
    numbers = {
        span for span, part in written_spans.items() if part.isdigit() and len(written_spans) > 2
    }
    if subscripts:  # a screw axis without one stands alone
        screws_left = screws - subscripts - {start + 1 for start, _ in written_spans}
    else:
        screws_left = set[int]()
    return (
        {end for _, end in written_spans} <= {end for _, end in spans}
        and subscripts <= screws
        and numbers <= spans.keys()
        and not screws_left
    )


def _spans(parts: Sequence[str]) -> dict[tuple[int, int], str]:
    """Return parts by where they begin and end when they are put together."""
    ends = [sum(map(len, parts[: k + 1])) for k in range(len(parts))]
    return {(end - len(part), end): part for part, end in zip(parts, ends, strict=True)}


@lru_cache(maxsize=1)
def _symbols(gemmi: Any) -> dict[str, list[_Symbol]]:
    """Return all symbols by their letters without blanks, in small letters."""
    table: dict[str, list[_Symbol]] = {}
    for number, row in enumerate(gemmi.spacegroup_table()):
        for parts in _ways(row):
            lower = tuple(part.lower() for part in parts)
            table.setdefault("".join(lower), []).append(_Symbol(lower, number < USUAL, row))
    return table


def _ways(row: Any) -> list[list[str]]:
    """Return the parts of a setting's symbol as it is listed, and of other ways to write it."""
    parts: list[str] = row.hm.split()
    if not all(re.fullmatch(r"[A-Z]|-?[1-6]{1,2}(/[a-enm])?|[a-enm]", part) for part in parts):
        return []  # a few of gemmi's own, such as "P 21212(a)"
    ways = [parts, *(new.split() for new, old in _AFTER_2002.items() if old == row.hm)]
    if len(parts) == 4 and parts[1:].count("1") == 2:  # monoclinic
        ways.append([parts[0], *(part for part in parts[1:] if part != "1")])
    if row.point_group_hm() in _ABBREVIATED:
        ways += [full for way in tuple(ways) for full in _full_symbols(row, way)]
    if len(parts) > 2 and parts[2] == "-3":  # cubic, before the bar was written
        ways += [[*way[:2], "3", *way[3:]] for way in tuple(ways)]
    if row.ext == "H":  # as the PDB writes them
        ways += [["H", *way[1:]] for way in tuple(ways)]
    return ways


def _full_symbols(row: Any, parts: Sequence[str]) -> list[list[str]]:
    """Return the parts of a short symbol with an axis before each mirror: "P 2/m 2/m 2/m" of P m m m.

    Where a centred cell has two sorts of axes along one direction, either may be named.
    """
    point_group: str = row.point_group_hm()
    directions: dict[int, int] = {}  # edges of the cell, by the place in the symbol
    if point_group == "mmm":
        directions = {1: 0, 2: 1, 3: 2}
    elif point_group == "4/mmm":
        directions = {2: 0}
    elif point_group in ("m-3", "m-3m"):
        directions = {1: 2}
    fold = 4 if point_group == "m-3m" else 2
    choices = [
        [part]
        if not re.fullmatch("[a-enm]", part)
        else [f"{axis}/{part}" for axis in _axes(row, directions[at], fold)]
        if at in directions
        else [f"2/{part}"]
        for at, part in enumerate(parts)
    ]
    return [list(full) for full in product(*choices)]


def _axes(row: Any, edge: int, fold: int) -> list[str]:
    """Return the rotation and screw axes of 2 or 4 that are along an edge of the cell."""
    operations = row.operations()
    unit = operations.sym_ops[0].DEN
    trace = {2: -1, 4: 1}[fold]
    turns = [
        op
        for op in operations.sym_ops
        if op.det_rot() > 0
        and op.rot[edge][edge] == unit
        and sum(op.rot[k][k] for k in range(3)) == trace * unit
    ]
    shifts = {
        (op.tran[edge] + centring[edge]) * fold // unit % fold
        for op in turns
        for centring in operations.cen_ops
    }
    return [f"{fold}{shift or ''}" for shift in sorted(shifts)]
