"""The affine frame between a silhouette's normal form and the input that it was read from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Self, overload

import numpy as np
from numpy.typing import ArrayLike

from orbiflow.arguments import is_tensor, numbers
from orbiflow.arrays import Array
from orbiflow.errors import OrbiflowError

if TYPE_CHECKING:
    import torch


@dataclass(frozen=True, eq=False)
class Frame:
    """Where a normal form (y up, area 1, centroid 0) lies in the input: input = linear normal + offset.

    - `linear`: (2, 2), invertible, input units for one unit of the normal form; read-only.
    - `offset`: (2,), the normal form's origin in input units; read-only.
    - `kind`: of the input: "image", "svg", "dat", "json" or "polygon".
    - `size`: width and height of the picture or page in input units, where there is one.
    - `corner`: its corner of least coordinates. In an image that is (0, 0) and the unit is the pixel:
      the pixel in row i, column j, counted from 0, has its centre at (j + 1/2, i + 1/2).

    Raises `OrbiflowError` for arrays of other shapes, entries that are not finite numbers, and a
    matrix without an inverse.

    >>> frame = Frame([[20, 0], [0, -20]], [50, 40], kind="image", size=(100, 80))
    >>> frame.to_input([1.0, 1.0]).tolist(), frame.to_normal([70, 20]).tolist(), frame.y_down
    ([70.0, 20.0], [1.0, 1.0], True)
    """

    linear: Array
    offset: Array
    kind: str = "polygon"
    size: tuple[float, float] | None = None
    corner: tuple[float, float] = (0.0, 0.0)
    inverse: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        linear = _numbers(self.linear, (2, 2), "linear")
        size = None if self.size is None else _pair(self.size, "size")
        if size is not None and not min(size) > 0:
            raise OrbiflowError(f"a frame's size must be positive, got {size}")
        # relative to the scale: a frame may be tiny
        determinant = linear[0, 0] * linear[1, 1] - linear[0, 1] * linear[1, 0]
        if not abs(determinant) > 1e-12 * np.abs(linear).max() ** 2:
            raise OrbiflowError(f"a frame's linear part has no inverse: {linear.tolist()}")
        arrays = {
            "linear": linear,
            "offset": _numbers(self.offset, (2,), "offset"),
            "inverse": np.linalg.inv(linear),
        }
        for name, array in arrays.items():
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        object.__setattr__(self, "size", size)
        object.__setattr__(self, "corner", _pair(self.corner, "corner"))

    @property
    def y_down(self) -> bool:
        """Whether the input's y axis points down: the frame turns the plane over."""
        return bool(np.linalg.det(self.linear) < 0)

    @overload
    def to_input(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def to_input(self, points: ArrayLike) -> Array: ...
    def to_input(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Points (..., 2) of the normal form in the input's units; arrays, lists or tensors."""
        if is_tensor(points):
            points = _tensor(points)
            return points @ points.new_tensor(self.linear).T + points.new_tensor(self.offset)
        return numbers(points, "points", (..., 2), finite=False) @ self.linear.T + self.offset

    @overload
    def to_normal(self, points: torch.Tensor) -> torch.Tensor: ...
    @overload
    def to_normal(self, points: ArrayLike) -> Array: ...
    def to_normal(self, points: torch.Tensor | ArrayLike) -> torch.Tensor | Array:
        """Points (..., 2) in the input's units, in the normal form; arrays, lists or tensors."""
        if is_tensor(points):
            points = _tensor(points)
            return (points - points.new_tensor(self.offset)) @ points.new_tensor(self.inverse).T
        local = numbers(points, "points", (..., 2), finite=False) - self.offset
        scale = np.diag(self.linear)
        if np.array_equal(self.linear, np.diag(scale)):
            return local / scale  # rounded once
        return local @ self.inverse.T

    def as_dict(self) -> dict[str, Any]:
        """Everything, ready for JSON; `from_dict` undoes it bit for bit."""
        return {
            "linear": self.linear.tolist(),
            "offset": self.offset.tolist(),
            "y_down": self.y_down,
            "kind": self.kind,
            "size": None if self.size is None else list(self.size),
            "corner": list(self.corner),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> Self:
        """The frame that `as_dict` wrote.

        Raises `OrbiflowError` for values that are missing or do not make a frame.
        """
        try:
            size = values["size"]
            frame = cls(
                values["linear"],
                values["offset"],
                str(values["kind"]),
                None if size is None else tuple(size),
                tuple(values["corner"]),
            )
            y_down = values["y_down"]
        except (KeyError, TypeError) as error:
            raise OrbiflowError(f"the frame is incomplete: {error}") from error
        if y_down is not frame.y_down:
            raise OrbiflowError(f"the frame's y_down is {y_down!r}, its linear part says otherwise")
        return frame


def _tensor(points: torch.Tensor) -> torch.Tensor:
    if points.ndim == 0 or points.shape[-1] != 2:
        raise OrbiflowError(f"points: expected shape (..., 2), got {tuple(points.shape)}")
    return points if points.is_floating_point() else points.double()


def _numbers(values: Any, shape: tuple[int, ...], name: str) -> Array:
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OrbiflowError(f"a frame's {name} must be numbers of shape {shape}") from error
    if array.shape != shape or not np.isfinite(array).all():
        raise OrbiflowError(
            f"a frame's {name} must be finite numbers of shape {shape}, got {array.tolist()}"
        )
    return array


def _pair(values: Any, name: str) -> tuple[float, float]:
    first, second = _numbers(values, (2,), name).tolist()
    return first, second
