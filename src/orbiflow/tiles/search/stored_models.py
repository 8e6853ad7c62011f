"""Finished models: the polygon of a candidate, plain arrays for files, and models of these."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import torch

from orbiflow.arguments import as_instance, as_number, as_whole
from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.tiles.search.candidates import CORNERS, VERTICES, simplest_tile
from orbiflow.tiles.search.method import MAX_FREQUENCY, MAX_SEGMENTS
from orbiflow.tiles.search.model import TileModel
from orbiflow.tiles.silhouette import Bending, Frame
from orbiflow.tiles.tile_map import TileMap, naming_file
from orbiflow.tiles.tilings import Tile, isohedral_class
from orbiflow.typed_torch import listed

MAX_STEPS = 1024  # integration steps of a segment beyond which a field counts as too steep


@torch.no_grad()
def converge(
    model: TileModel, points: torch.Tensor, *, tolerance: float = 1e-7, force: bool = False
) -> tuple[torch.Tensor, float]:
    """Double the integration steps of a single candidate until the flow is accurate.

    Quality is judged at the steps set here, never at those of the optimisation (design point 5).
    Returns the points (1, N, 2) carried at the doubled steps, and the error estimate. With `force`
    the flow is taken after `MAX_STEPS`, accurate or not; else a field that is too steep is a
    `CertificationError`.
    """
    coarse = model.flow(points)
    while True:
        finer = model.flow.with_steps(2 * model.flow.steps)
        fine = finer(points)
        error = float((fine - coarse).abs().max())
        if not math.isfinite(error):
            raise CertificationError("the flow has no finite values: lower the learning rate")
        model.flow = finer
        if error <= tolerance or (force and model.flow.steps >= MAX_STEPS):
            return fine, error
        if model.flow.steps >= MAX_STEPS:
            raise CertificationError(
                f"the flow is not accurate after {model.flow.steps} steps (error {error:.1e}): "
                "the field is too steep; lower max-frequency or raise the penalty"
            )
        coarse = fine


@torch.no_grad()
def extract_tile(model: TileModel, *, force: bool = False) -> tuple[Tile, TileModel]:
    """Return the tile of a single candidate in normal form, and the float64 model that made it.

    The polygon is the coarsest that is simple, see `simplest_tile`; with `force`, the finest.
    """
    as_instance(model, TileModel, "the model", "load_model and the fits give one")
    model.require_single()
    model = model.take([0]).double()
    model.flow = model.flow.with_steps(max(1, 8 // model.segments), method="rk4")
    vertices, corners = model.prototile()

    def moved(points: Array) -> Array:
        return converge(model, torch.as_tensor(points)[None], force=force)[0][0].numpy()

    tile = simplest_tile(
        model.isohedral_class,
        vertices[0].numpy(),
        listed(corners[0]),
        model.linear()[0].numpy(),
        model.offset.detach()[0].numpy(),
        moved=moved,
        force=force,
    )
    return tile, model


MAX_SIDES = 100_000


def as_map(model: TileModel, frame: Frame | None = None, bending: Bending | None = None) -> TileMap:
    """Return a single candidate as plain arrays; `frame` and `bending` go with it."""
    as_instance(model, TileModel, "the model", "load_model and the fits give one").require_single()
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
    return TileMap(settings, arrays, frame, bending)


def as_model(stored: TileMap) -> TileModel:
    """Return the model again, float64, one candidate, in the target's normal form."""
    settings, arrays = stored.settings, stored.arrays
    # before anything is built: each segment takes time and memory
    segments = sum(name.startswith("flow.") for name in arrays)
    if settings.get("segments") != segments:
        raise OrbiflowError(
            f"the model's settings say {settings.get('segments')!r} segments, "
            f"its arrays hold {segments}"
        )
    try:
        model = TileModel(
            isohedral_class(settings["class"]),
            torch.zeros(1, dtype=torch.float64),
            mirrored=torch.tensor([bool(settings["mirrored"])]),
            max_frequency=as_whole(settings["max_frequency"], "max_frequency", 0, MAX_FREQUENCY),
            segments=as_whole(settings["segments"], "segments", 1, MAX_SEGMENTS),
            smoothness=as_number(settings["smoothness"], "smoothness", 0, 100),
            steps=as_whole(settings["steps"], "steps", 1, 1_000_000),
            method=str(settings["method"]),
        )
    except (KeyError, TypeError) as error:
        raise OrbiflowError(f"the model's settings are incomplete: {error}") from error
    with torch.no_grad():
        for name, parameter in model.named_parameters():
            shape = tuple(parameter.shape[1:])
            parameter.copy_(torch.tensor(_checked(arrays.get(name), name, shape))[None])
    if VERTICES in arrays or CORNERS in arrays:
        vertices, corners = _prototile(arrays, len(model.template()[0]))
        model.vertices, model.corners = torch.tensor(vertices)[None], torch.tensor(corners)[None]
    return model


def load_model(path: str | Path) -> TileModel:
    """Read the flow of a `model.safetensors`: one candidate, float64, in the target's normal form.

    Raises:
        InputFileError: for a file that is missing, too large or not such a model.
    """
    stored = TileMap.read(path)
    with naming_file(path):
        return as_model(stored)


def _checked(stored: Array | None, name: str, shape: tuple[int, ...]) -> Array:
    if stored is None or stored.shape != shape:
        found = "nothing" if stored is None else f"shape {stored.shape}"
        raise OrbiflowError(f"the model's {name} should have shape {shape}, found {found}")
    if not np.isfinite(stored).all():
        raise OrbiflowError(f"the model's {name} has NaN or infinite entries")
    return stored


def _prototile(arrays: dict[str, Array], count: int) -> tuple[Array, Array]:
    vertices = np.asarray(arrays.get(VERTICES, np.zeros((0, 2))), dtype=np.float64)
    corners = np.asarray(arrays.get(CORNERS, np.zeros(0)))
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
