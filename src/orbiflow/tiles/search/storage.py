"""A fitted tile on disk: safetensors, never pickle."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.numpy import save

from orbiflow.arguments import instance
from orbiflow.arguments import path as as_path
from orbiflow.arrays import Array
from orbiflow.errors import InputFileError, OrbiflowError
from orbiflow.runtime import read_tensors
from orbiflow.tiles.search.carried import Bending
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.search.settings import MAX_FREQUENCY, MAX_SEGMENTS
from orbiflow.tiles.silhouette import Frame
from orbiflow.tiles.tilings import isohedral_class

FORMAT = "orbiflow-tile/1"
MAX_BYTES = 64 * 2**20
MAX_SIDES = 100_000
VERTICES, CORNERS = "prototile.outline", "prototile.corners"
BENDING = ("bending.rest", "bending.images", "bending.triangles")
"""Arrays of the map from the silhouette; earlier files have none, earlier readers pass over them."""
FRAME = "frame"
"""Entry of the settings in a file; not in those of version 0.1, which passes over it."""


@dataclass(frozen=True, eq=False)
class SavedModel:
    """A single candidate as plain arrays: what is sent between processes and kept in files.

    - `settings`: class, max_frequency, segments, smoothness, steps, method, mirrored.
    - `arrays`: float64 parameters by name, without the candidate axis; and the start tile, if it is
      not the template.
    - `frame`: where the target's normal form, the model's own coordinates, lies in the input; None if
      that is not known.
    - `bending`: the map from the silhouette onto the tile, in normal form; None if there is none.
    """

    settings: dict[str, Any]
    arrays: dict[str, Array]
    frame: Frame | None = None
    bending: Bending | None = None

    @classmethod
    def of(
        cls, model: TileModel, frame: Frame | None = None, bending: Bending | None = None
    ) -> SavedModel:
        """Take a single candidate apart; `frame` and `bending` go with it.

        Raises:
            OrbiflowError: for a model that holds more than one.
        """
        instance(model, TileModel, "the model", "load_model and the fits give one").require_single()
        settings = {
            "class": model.isohedral_class.name,
            "max_frequency": model.max_frequency,
            "segments": model.segments,
            "smoothness": model.smoothness,
            "steps": model.flow.steps,
            "method": model.flow.method,
            "mirrored": bool(model.mirror[0]),
        }
        arrays = {
            name: parameter.detach().double().cpu().numpy()[0].copy()
            for name, parameter in model.named_parameters()
        }
        if model.vertices is not None and model.corners is not None:
            arrays[VERTICES] = model.vertices.cpu().numpy()[0].copy()
            arrays[CORNERS] = model.corners.cpu().numpy()[0].copy()
        return cls(settings, arrays, frame, bending)

    def restore(self) -> TileModel:
        """The model again, float64, one candidate.

        Raises:
            OrbiflowError: if settings or arrays do not fit together.
        """
        self._check_segments()
        try:
            model = TileModel(
                isohedral_class(self.settings["class"]),
                torch.zeros(1, dtype=torch.float64),
                mirrored=torch.tensor([bool(self.settings["mirrored"])]),
                max_frequency=_whole(self.settings["max_frequency"], MAX_FREQUENCY, least=0),
                segments=_whole(self.settings["segments"], MAX_SEGMENTS),
                smoothness=_exponent(self.settings["smoothness"]),
                steps=_whole(self.settings["steps"], 1_000_000),
                method=str(self.settings["method"]),
            )
        except (KeyError, TypeError) as error:
            raise OrbiflowError(f"the model's settings are incomplete: {error}") from error
        with torch.no_grad():
            for name, parameter in model.named_parameters():
                stored = self.arrays.get(name)
                if stored is None or stored.shape != tuple(parameter.shape[1:]):
                    found = "nothing" if stored is None else f"shape {stored.shape}"
                    raise OrbiflowError(
                        f"the model's {name} should have shape {tuple(parameter.shape[1:])}, "
                        f"found {found}"
                    )
                if not np.isfinite(stored).all():
                    raise OrbiflowError(f"the model's {name} has NaN or infinite entries")
                parameter.copy_(torch.tensor(stored)[None])
        if VERTICES in self.arrays or CORNERS in self.arrays:
            vertices, corners = self._prototile(len(model.template()[0]))
            model.vertices, model.corners = (
                torch.tensor(vertices)[None],
                torch.tensor(corners)[None],
            )
        return model

    def _prototile(self, count: int) -> tuple[Array, Array]:
        vertices = np.asarray(self.arrays.get(VERTICES, np.zeros((0, 2))), dtype=np.float64)
        corners = np.asarray(self.arrays.get(CORNERS, np.zeros(0)))
        if vertices.ndim != 2 or vertices.shape[1] != 2 or not count <= len(vertices) <= MAX_SIDES:
            raise OrbiflowError(
                f"the model's {VERTICES} should have shape (N, 2) with N from {count} to "
                f"{MAX_SIDES}, found {vertices.shape}"
            )
        if not np.isfinite(vertices).all():
            raise OrbiflowError(f"the model's {VERTICES} has NaN or infinite entries")
        if (
            corners.shape != (count,)
            or corners.dtype.kind != "i"
            or corners[0] != 0
            or (np.diff(corners, append=len(vertices)) < 1).any()
        ):
            raise OrbiflowError(
                f"the model's {CORNERS} should be {count} increasing indices from 0, "
                f"less than {len(vertices)}"
            )
        return vertices, corners.astype(np.int64)

    def _check_segments(self) -> None:
        # before anything is built: each segment takes time and memory
        stored = sum(name.startswith("flow.") for name in self.arrays)
        if self.settings.get("segments") != stored:
            raise OrbiflowError(
                f"the model's settings say {self.settings.get('segments')!r} segments, "
                f"its arrays hold {stored}"
            )

    def to_bytes(self) -> bytes:
        """The contents of a `model.safetensors` file."""
        # one entry: the library writes several in random order, and the same seed gives one file
        frame = {} if self.frame is None else {FRAME: self.frame.as_dict()}
        metadata = {FORMAT: json.dumps({**self.settings, **frame}, sort_keys=True)}
        bending = {} if self.bending is None else _arrays_of(self.bending)
        stored = {**self.arrays, **bending}
        arrays = {name: np.array(a, order="C") for name, a in stored.items()}  # keeps 0-d
        return save(arrays, metadata=metadata)


def load_saved(path: str | Path) -> SavedModel:
    """Read a `model.safetensors` that `orbiflow escherize` wrote, with the input's frame.

    The model itself is checked by `SavedModel.restore`, which makes it; `frame` says where the tile
    lies in the input, and `bending` is the map from the silhouette: `None` in files from before them.

    Raises:
        InputFileError: for a file that is missing, too large or not such a model.
    """
    path = as_path(path, "the model's file")
    settings, tensors = read_tensors(path, "a tile model", key=FORMAT, max_bytes=MAX_BYTES)
    with _naming(path):
        arrays: dict[str, Array] = {name: tensor.numpy() for name, tensor in tensors.items()}
        stored = settings.pop(FRAME, None)
        frame = None if stored is None else Frame.from_dict(stored)
        return SavedModel(settings, arrays, frame, _bending_in(arrays))


def load_model(path: str | Path) -> TileModel:
    """The map alone of `load_saved`.

    Returns:
        One candidate, float64, in the target's normal form (y up, area 1, centroid 0).

    Raises:
        InputFileError: for a file that is missing, too large or not such a model.
    """
    saved = load_saved(path)
    with _naming(path):
        return saved.restore()


def _arrays_of(bending: Bending) -> dict[str, Array]:
    return dict(zip(BENDING, (bending.rest, bending.images, bending.triangles), strict=True))


def _bending_in(arrays: dict[str, Array]) -> Bending | None:
    """Take the map out of a file's arrays."""
    found = {name: arrays.pop(name) for name in BENDING if name in arrays}
    if not found:
        return None
    missing = [name for name in BENDING if name not in found]
    if missing:
        raise OrbiflowError(f"the model's {', '.join(missing)} is missing")
    return Bending(*(found[name] for name in BENDING))


@contextlib.contextmanager
def _naming(path: str | Path) -> Generator[None]:
    """Whatever is wrong inside, said with the file's name."""
    try:
        yield
    except (ValueError, KeyError, TypeError) as error:
        raise InputFileError(f"{path}: not an orbiflow tile model: {error}") from error


def _exponent(value: Any) -> float:
    number = float(value)
    if not 0.0 <= number <= 100.0:
        raise OrbiflowError(f"expected a smoothness from 0 to 100, got {value!r}")
    return number


def _whole(value: Any, most: int, least: int = 1) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise OrbiflowError(f"expected a whole number from {least} to {most}, got {value!r}")
    return value
