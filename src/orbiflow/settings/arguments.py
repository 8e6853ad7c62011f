"""Checks of arguments and settings: one vocabulary, one wording, for the whole package.

Each function `as_...(value, name, ...)` returns the value as it will be used, or raises a
`SettingError` that names the argument, says what is allowed and shows what was given. Settings classes
(`orbiflow.settings`) use the same ranges and words. A `name` that is a phrase rather than an identifier
("the file to export to") opens the message as it is.

No numerical library is imported until an array or a tensor is really needed.
"""

from __future__ import annotations

import difflib
import math
import numbers as abstract
import operator
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import EllipsisType, UnionType
from typing import TYPE_CHECKING, Any, TypeGuard, TypeVar, cast

from orbiflow.errors import SettingError, literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from torch import Tensor

Kind = TypeVar("Kind")
Choice = TypeVar("Choice", bound=str)
Number = TypeVar("Number", int, float)
Shape = tuple[int | str | EllipsisType, ...]


@dataclass(frozen=True)
class Range:
    """The numbers that are allowed, all finite.

    - `least`, `most`: The bounds, which are allowed themselves. Default: no bound.
    - `above`, `below`: The bounds, which are not. Default: no bound.

    >>> str(Range(1, 100)), str(Range(above=0)), str(Range(above=0, below=1))
    ('from 1 to 100', 'above 0', 'above 0 and below 1')
    """

    least: float | None = None
    most: float | None = None
    above: float | None = None
    below: float | None = None

    def __contains__(self, value: float) -> bool:
        is_finite = isinstance(value, int) or math.isfinite(value)
        return is_finite and all(fits(value, bound) for bound, (fits, *_) in self._bounds())

    def __str__(self) -> str:
        if self.least is not None and self.most is not None:
            return f"from {_plainly(self.least)} to {_plainly(self.most)}"
        return " and ".join(f"{word} {_plainly(bound)}" for bound, (_, word, _) in self._bounds())

    @property
    def schema(self) -> dict[str, float]:
        """The keywords of JSON Schema for these bounds."""
        return {keyword: bound for bound, (*_, keyword) in self._bounds()}

    def _bounds(self) -> Iterator[tuple[float, tuple[Callable[[float, float], bool], str, str]]]:
        """Yield each bound that there is, with what is known of its kind."""
        for name, kind in _BOUNDS.items():
            if (bound := getattr(self, name)) is not None:
                yield bound, kind


_BOUNDS: dict[str, tuple[Callable[[float, float], bool], str, str]] = {
    "least": (operator.ge, "at least", "minimum"),
    "above": (operator.gt, "above", "exclusiveMinimum"),
    "most": (operator.le, "at most", "maximum"),
    "below": (operator.lt, "below", "exclusiveMaximum"),
}
"""Of each kind of bound: the comparison that holds, its words, and its keyword in JSON Schema."""

ANY = Range()


def refusal(name: str, wanted: str, value: Any, hint: str = "") -> SettingError:
    """Return the error for a value that is not what is wanted.

    >>> print(refusal("dpi", "a number above 0", "many", "300 suits most printers"))
    dpi must be a number above 0, got 'many'; 300 suits most printers
    """
    more = f"; {literal(hint)}" if hint else ""
    return SettingError(
        f"{placeholder(name)} must be {literal(wanted)}, got {literal(described(value))}{more}"
    )


def placeholder(name: str) -> str:
    """Return how the template of a `SettingError` names an argument."""
    return f"{{{name}}}" if name.isidentifier() else literal(name)


def as_instance(value: Any, kind: type[Kind], name: str, hint: str = "") -> Kind:
    """Return `value`, which must be of the class `kind`; `hint` says where to get one.

    >>> as_instance("torus", int, "dim")
    Traceback (most recent call last):
    orbiflow.errors.SettingError: dim must be an int, got 'torus'
    """
    if isinstance(value, kind):
        return value
    raise refusal(name, _with_article(kind.__name__), value, hint)


def as_choice(value: Any, choices: Sequence[Choice], name: str) -> Choice:
    """Return `value`, which must be one of `choices`.

    >>> as_choice("skelton", ("none", "skeleton"), "cut")
    Traceback (most recent call last):
    orbiflow.errors.SettingError: cut must be none or skeleton, got 'skelton'; did you mean skeleton?
    """
    if isinstance(value, str) and value in choices:
        return choices[choices.index(cast(Any, value))]
    raise refusal(name, one_of(choices), value, meant(value, choices))


def as_whole(value: Any, name: str, least: float | None = None, most: float | None = None) -> int:
    """Return `value` as an integer in the range; Booleans and fractions are refused.

    >>> as_whole(0, "copies", 1)
    Traceback (most recent call last):
    orbiflow.errors.SettingError: copies must be at least 1, got 0
    """
    return _in_range(value, name, Range(least, most), operator.index, whole=True)


def as_number(
    value: Any,
    name: str,
    least: float | None = None,
    most: float | None = None,
    *,
    above: float | None = None,
    below: float | None = None,
) -> float:
    """Return `value` as a finite number in the range; Booleans and text are refused.

    >>> as_number(float("nan"), "dpi", above=0)
    Traceback (most recent call last):
    orbiflow.errors.SettingError: dpi must be a finite number above 0, got nan
    """
    return _in_range(value, name, Range(least, most, above, below), float)


def _in_range(
    value: Any, name: str, allowed: Range, made: Callable[[Any], Number], *, whole: bool = False
) -> Number:
    refused = isinstance(value, str | bytes) or _is_boolean(value)
    try:
        result = None if refused else made(value)
    except (TypeError, ValueError, OverflowError):
        result = None
    if result is None or result not in allowed:
        raise refusal(name, number_wanted(allowed, result, whole=whole), value)
    return result


def as_path(value: Any, name: str) -> Path:
    """Return `value`, text or a path, as a `Path`."""
    text = path_text(value)
    if text is None:
        raise refusal(name, "a path", value)
    return Path(text)


def path_text(value: Any) -> str | None:
    """Return the text of a path that a file can have, or None for anything else."""
    # what a PathLike is made of, isinstance does not say
    text: Any = cast(Any, os.fspath)(value) if is_a(value, str | os.PathLike) else None
    return text if isinstance(text, str) and text and "\0" not in text else None


def as_array(values: Any, name: str, shape: Shape, *, finite: bool = True) -> NDArray[np.float64]:
    """Return real numbers in any container as a new float64 array.

    Args:
        values: Nested lists, an array of any real dtype, or a tensor.
        name: The argument's name.
        shape: The shape that is wanted; entries are lengths, names for any length, or a leading `...`.
        finite: Whether NaN and infinity are refused.

    >>> as_array([[0, 1]], "points", (..., 2)).shape
    (1, 2)
    """
    import numpy as np

    sizes = ", ".join("..." if n is ... else str(n) for n in shape)
    wanted = f"real numbers of shape ({sizes}{',' * (len(shape) == 1)})"
    if is_tensor(values):
        values = values.detach().cpu()
        # NumPy has no bfloat16
        values = (values.double() if values.is_floating_point() else values).numpy()
    try:
        raw = np.asarray(values)
        if raw.dtype.kind not in "biuf":
            raw = raw.astype(object)  # so that neither text nor complex numbers slip through
            if any(isinstance(item, str | bytes | complex) for item in raw.ravel()):
                raise TypeError
        array = np.array(raw, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise refusal(name, wanted, values) from error
    if not _fits(array.shape, shape):
        raise refusal(name, wanted, array)
    if finite and not np.isfinite(array).all():
        raise refusal(name, "finite", values, "remove NaN and infinity first")
    return array


def as_tensor(value: Any, name: str) -> Tensor:
    """Return a floating-point tensor as it is, and other real numbers as one of float64.

    >>> as_tensor([[1, 2]], "points")
    tensor([[1., 2.]], dtype=torch.float64)
    """
    import numpy as np
    import torch

    if not isinstance(value, torch.Tensor):
        try:
            value = torch.as_tensor(np.array(value, dtype=np.float64))
        except (TypeError, ValueError) as error:
            raise refusal(name, "real numbers", value, str(error)) from error
    if value.is_complex():
        raise refusal(name, "real numbers", value, f"its dtype is {value.dtype}")
    return value if value.is_floating_point() else value.double()


def as_points(value: Any, dim: int, name: str = "points", *, flat: bool = False) -> Tensor:
    """Return finite points as a tensor of shape (..., dim), or (N, dim) if `flat`."""
    points = as_tensor(value, name)
    if not points.dim() or points.shape[-1] != dim or (flat and points.dim() != 2):
        raise refusal(name, f"points of shape ({'N' if flat else '...'}, {dim})", points)
    from orbiflow.typed_torch import transformed

    # under torch.func there are no values to look at
    if not transformed() and not bool(points.detach().isfinite().all()):
        raise refusal(name, "finite", points, "remove what is missing or infinite first")
    return points


def is_a(value: object, kind: type | UnionType) -> bool:
    """Return `isinstance(value, kind)`, for values that a type checker believes it knows."""
    return isinstance(value, kind)


def described(value: Any) -> str:
    """Return in a few words what a wrong argument is.

    >>> described("IH4"), described([[0, 1]])
    ("'IH4'", 'a list of 1')
    """
    if _is_array(value) or is_tensor(value):
        what = "an array" if _is_array(value) else "a tensor"
        return f"{what} of shape {tuple(value.shape)}"
    if is_a(value, list | tuple | dict | set):
        return f"a {type(value).__name__} of {len(value)}"
    shown: Any = str(value) if is_a(value, Path) else value
    if is_a(shown, str | bytes | abstract.Number | None):
        return f"{shown.item() if hasattr(shown, 'item') else shown!a:.60}"
    return _with_article(type(value).__name__)


def number_wanted(allowed: Range, number: float | None = None, *, whole: bool = False) -> str:
    """Return what a value must be, in words: of a finite number, only the range.

    >>> number_wanted(Range(above=0)), number_wanted(Range(above=0), -1.0)
    ('a number above 0', 'above 0')
    >>> number_wanted(Range(above=0), math.nan)
    'a finite number above 0'
    """
    if isinstance(number, int) or (number is not None and math.isfinite(number)):
        return str(allowed)
    noun = "whole number" if whole else "number" if number is None else "finite number"
    return f"a {noun} {allowed}".strip()


def one_of(choices: Sequence[object]) -> str:
    """Return choices in words.

    >>> one_of(("svg", "pdf", "png"))
    'svg, pdf or png'
    """
    *first, last = map(str, choices)
    return f"{', '.join(first)} or {last}" if first else last


def meant(value: object, choices: Sequence[object]) -> str:
    """Return a question for the choice that a mistyped value is closest to, or ""."""
    near = difflib.get_close_matches(str(value), list(map(str, choices)), n=1)
    return f"did you mean {near[0]}?" if near else ""


def _plainly(bound: float) -> str:
    if bound != int(bound):
        return f"{bound:g}"
    power = (abs(int(bound)) + 1).bit_length() - 1
    if power > 20 and bound in (2**power, -(2**power), 2**power - 1):
        return f"{'-' if bound < 0 else ''}2^{power}{' - 1' if bound == 2**power - 1 else ''}"
    return str(int(bound))


def _is_boolean(value: object) -> bool:
    return isinstance(value, bool) or type(value).__name__ in ("bool", "bool_")


def _is_array(value: object) -> bool:
    numpy = sys.modules.get("numpy")
    return numpy is not None and isinstance(value, numpy.ndarray)


def is_tensor(value: object) -> TypeGuard[Tensor]:
    """Whether a value is a torch tensor, without importing torch, which a tensor's owner has done."""
    torch = sys.modules.get("torch")
    return torch is not None and isinstance(value, torch.Tensor)


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"


def _fits(actual: tuple[int, ...], wanted: Shape) -> bool:
    if wanted and wanted[0] is ...:
        wanted = wanted[1:]
        actual = actual[max(0, len(actual) - len(wanted)) :]
    return len(actual) == len(wanted) and all(
        isinstance(want, str) or have == want for have, want in zip(actual, wanted, strict=True)
    )
