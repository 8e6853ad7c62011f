"""Arguments of public functions: taken as they are meant, or refused with what to give instead."""

from __future__ import annotations

import math
import operator
import os
from pathlib import Path
from types import EllipsisType, UnionType
from typing import Any, TypeVar

import numpy as np
import torch
from numpy.typing import NDArray

from orbiflow.errors import OrbiflowError

Kind = TypeVar("Kind")
Shape = tuple[int | str | EllipsisType, ...]


def instance(value: Any, kind: type[Kind], name: str, how: str = "") -> Kind:
    """`value`, which must be a `kind`; `how` says where one comes from.

    Raises `OrbiflowError` for anything else.
    """
    if isinstance(value, kind):
        return value
    raise OrbiflowError(
        f"{name} must be {_with_article(kind.__name__)}, got {described(value)}{how and '; ' + how}"
    )


def is_a(value: object, kind: type | UnionType) -> bool:
    """`isinstance` of what is annotated as it should be, and may be anything all the same."""
    return isinstance(value, kind)


def numbers(values: Any, name: str, shape: Shape, *, finite: bool = True) -> NDArray[np.float64]:
    """`values` (nested lists, an array of any real dtype, a tensor) as a new float64 array.

    Args:
        values: what a user gave.
        name: of the argument, which opens each message.
        shape: whose entries are lengths, names for any length, or a leading `...`.
        finite: whether NaN and infinity are refused.

    Raises `OrbiflowError` for what is not real numbers of that shape.

    >>> numbers([[0, 1]], "points", (..., 2)).shape
    (1, 2)
    """
    wanted = f"({', '.join('...' if n is ... else str(n) for n in shape)}{',' * (len(shape) == 1)})"
    if isinstance(values, torch.Tensor):
        values = values.detach().cpu()
        # NumPy has no bfloat16
        values = (values.double() if values.is_floating_point() else values).numpy()
    try:
        given = np.asarray(values)
        if given.dtype.kind not in "biuf":
            given = given.astype(object)  # so that neither text nor complex numbers slip through
            if any(isinstance(item, str | bytes | complex) for item in given.ravel()):
                raise TypeError
        array = np.array(given, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        raise OrbiflowError(
            f"{name}: expected real numbers of shape {wanted}, got {described(values)}"
        ) from error
    if not _fits(array.shape, shape):
        raise OrbiflowError(f"{name}: expected shape {wanted}, got {array.shape}")
    if finite and not np.isfinite(array).all():
        raise OrbiflowError(f"{name}: every number must be finite, found NaN or infinity")
    return array


def whole(value: Any, name: str, least: int, most: int | None = None) -> int:
    """`value` as an integer from `least` to `most`; Booleans and fractions are refused."""
    bounds = f"at least {least}" if most is None else f"from {least} to {_plainly(most)}"
    try:
        if isinstance(value, bool | np.bool_):
            raise TypeError
        result = operator.index(value)
    except TypeError as error:
        raise OrbiflowError(f"{name} must be a whole number {bounds}, got {value!r}") from error
    if result < least or (most is not None and result > most):
        raise OrbiflowError(f"{name} must be {bounds}, got {value!r}")
    return result


def _plainly(bound: int) -> str:
    power = (bound + 1).bit_length() - 1
    return f"2^{power} - 1" if power > 20 and bound + 1 == 2**power else str(bound)


def number(
    value: Any, name: str, least: float = -math.inf, most: float = math.inf, *, above: bool = False
) -> float:
    """`value` as a finite number from `least` to `most`; with `above` it must exceed `least`."""
    if above:
        bounds = f"above {least:g}" + (f" and at most {most:g}" if most < math.inf else "")
    else:
        bounds = f"from {least:g} to {most:g}" if most < math.inf else f"at least {least:g}"
    try:
        if isinstance(value, str | bytes):
            raise TypeError
        result = float(value)
    except (TypeError, ValueError) as error:
        raise OrbiflowError(f"{name} must be a number {bounds}, got {value!r}") from error
    inside = least < result <= most if above else least <= result <= most
    if not (inside and math.isfinite(result)):
        raise OrbiflowError(f"{name} must be {bounds}, got {value!r}")
    return result


def path(value: Any, name: str) -> Path:
    """`value`, text or a path, as a path."""
    given: Any = value  # which stays as it is: of what a PathLike is, isinstance does not say
    if isinstance(value, str | os.PathLike) and isinstance(os.fspath(given), str):
        return Path(given)
    raise OrbiflowError(f"{name} must be a path, got {described(value)}")


def described(value: Any) -> str:
    """What a wrong argument is, in a few words.

    >>> described("IH4"), described([[0, 1]]), described(np.zeros((2, 3)))
    ("'IH4'", 'a list of 1', 'an array of shape (2, 3)')
    """
    given: Any = value
    if isinstance(value, np.ndarray | torch.Tensor):
        what = "an array" if isinstance(value, np.ndarray) else "a tensor"
        return f"{what} of shape {tuple(given.shape)}"
    if isinstance(value, list | tuple | dict | set):
        return f"a {type(given).__name__} of {len(given)}"
    if value is None or isinstance(value, str | bytes | int | float | complex):
        return f"{value!a:.60}"
    return _with_article(type(value).__name__)


def _with_article(name: str) -> str:
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}"


def _fits(actual: tuple[int, ...], wanted: Shape) -> bool:
    if wanted and wanted[0] is ...:
        wanted = wanted[1:]
        actual = actual[max(0, len(actual) - len(wanted)) :]
    return len(actual) == len(wanted) and all(
        isinstance(want, str) or have == want for have, want in zip(actual, wanted, strict=True)
    )
