"""Candidate tiles of one class: D = A o L o flow applied to the template (design points 6-8).

Finished, they are a polygon and plain arrays for files, from which a model is made again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Self

import numpy as np
import torch
from numpy.typing import ArrayLike
from torch import Tensor, nn

from orbiflow.arrays import Array
from orbiflow.errors import CertificationError, InputFileError, OrbiflowError
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.settings import as_array, as_instance, as_number, as_whole, is_a
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.tiles.search import ClassCandidates, Prototiles, StillTiles, simplest_tile
from orbiflow.tiles.silhouette import Bending, Frame
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tile_map import TileMap, naming_file
from orbiflow.tiles.tilings import IsohedralClass, Tile
from orbiflow.tiles.tilings import isohedral_class as class_of
from orbiflow.typed_torch import linalg, listed

MAX_FREQUENCY = 60  # largest Omega that a fit takes on; time and memory grow with its square
MAX_SEGMENTS = 2000  # of a flow; the descent adds one a step

# Names under which the arrays of a map hold the start tile, if it is not the template
VERTICES, CORNERS = "prototile.outline", "prototile.corners"
NO_FLOW = "no flow made this tile, so there is no model of it; a search for overlap has one"


class TileModel(nn.Module, ClassCandidates):
    """A stack of S candidate tiles of one isohedral class, in the target's normal form.

    The flow commutes with the class's group in the group's own frame; the lattice freedom L and the
    similarity A come after it, composed and not mixed in: the paper's V_sym(A^-1 z) loses the glide
    reflections as soon as A rotates (design point 6). A template of area 1 is the start. Points are
    (S, N, 2); arrays and lists are taken as tensors of the model's dtype.

    Certificates outlive a change of precision: `.float()`, `.half()`, `.to(...)` round the
    parameters, which only makes another tile, but `vertices`, whose identified edges must correspond,
    stay float64, and the polygon with its group (`extract_tile`) is computed in float64.

    Args:
        isohedral_class: The class of all S tiles, or its name.
        angles: The turn (S,) of each start, in radians; a number is one.
        mirrored: Whether (S,) A reverses orientation. Default: no.
        max_frequency, segments, smoothness: Omega of the fields, the number of stationary pieces of the
            flow, and the Sobolev exponent of the fields' parameters.
        steps, method: Steps and method of the integrator.
        dtype: The type of all parameters.
        prototiles: S start tiles with their poses, in place of the template, `angles` and `mirrored`.
    """

    mirror: Tensor
    vertices: Tensor | None
    corners: Tensor | None

    def __init__(
        self,
        isohedral_class: IsohedralClass | str | int,
        angles: Tensor | ArrayLike | None = None,
        *,
        mirrored: Tensor | ArrayLike | None = None,
        max_frequency: int = 10,
        segments: int = 1,
        smoothness: float = 1.0,
        steps: int = 8,
        method: str = "rk4",
        dtype: torch.dtype = torch.float64,
        prototiles: Prototiles | None = None,
    ) -> None:
        super().__init__()
        isohedral_class = class_of(isohedral_class)
        if not (is_a(dtype, torch.dtype) and dtype.is_floating_point):
            raise OrbiflowError(
                f"dtype must be a floating-point type such as torch.float64, got {dtype}"
            )
        as_number(smoothness, "smoothness", 0)
        as_whole(segments, "segments", 1)
        if prototiles is not None:
            as_instance(prototiles, Prototiles, "prototiles")
            angles, mirrored = prototiles.angle, prototiles.mirrored
        if angles is None:
            raise OrbiflowError("a tile model needs angles or prototiles")
        turns = torch.as_tensor(np.atleast_1d(as_array(angles, "angles", (...,))))
        if turns.ndim != 1 or not len(turns):
            raise OrbiflowError(
                f"angles: expected shape (S,), S at least 1, got {tuple(turns.shape)}"
            )
        size = len(turns)
        self.isohedral_class = isohedral_class
        self.group: CrystallographicGroup = isohedral_class.group()
        area = self.group.cell_volume / self.group.order
        self.angle = nn.Parameter(turns.to(dtype))
        self.log_scale = nn.Parameter(torch.full((size,), -0.5 * math.log(area), dtype=dtype))
        self.offset = nn.Parameter(torch.zeros(size, 2, dtype=dtype))
        self.shape = nn.Parameter(torch.zeros(size, isohedral_class.shape_dim, dtype=dtype))
        self.stretch = nn.Parameter(torch.zeros(size, isohedral_class.stretch_dim, dtype=dtype))
        flips = np.zeros(size) if mirrored is None else as_array(mirrored, "mirrored", (size,))
        self.register_buffer("mirror", torch.as_tensor(flips != 0))
        fields = [
            FourierField(self.group, max_frequency, batch=size, smoothness=smoothness, dtype=dtype)
            for _ in range(segments)
        ]
        self.flow = Flow(fields, steps=steps, method=method, warn=False)
        self.max_frequency = max_frequency
        self.segments = segments
        self.smoothness = smoothness
        self.register_buffer("vertices", None)
        self.register_buffer("corners", None)
        if prototiles is not None:
            self.start_from(prototiles)
            return
        with torch.no_grad():  # each template's centre at the target's centroid
            center = self.template().mean(dim=-2, keepdim=True) @ self.linear().mT
            self.offset.copy_(-center[:, 0])

    @torch.no_grad()
    def start_from(self, prototiles: Prototiles) -> None:
        """Take S start tiles with their poses, in place of those that there are."""
        kind = self.isohedral_class
        dimensions = prototiles.corners.shape[-1], prototiles.stretch.shape[-1]
        if dimensions != (len(kind.template()), kind.stretch_dim):
            raise OrbiflowError(f"the prototiles are not of class {kind.name}")
        self.vertices = torch.tensor(prototiles.vertices, dtype=torch.float64)
        self.corners = torch.tensor(prototiles.corners)
        self.mirror = torch.tensor(prototiles.mirrored)
        for name in ("angle", "log_scale", "offset", "stretch"):
            getattr(self, name).copy_(torch.tensor(getattr(prototiles, name)))

    @property
    def size(self) -> int:
        """The number S of candidates."""
        return len(self.angle)

    def template(self) -> Tensor:
        """Return vertices (S, K, 2) of each candidate's template."""
        return self.isohedral_class.template(self.shape)

    def linear(self) -> Tensor:
        """Return the linear part of A o L, (S, 2, 2)."""
        c, s = self.angle.cos(), self.angle.sin()
        sign = torch.where(self.mirror, -1.0, 1.0).to(c)
        turn = torch.stack([torch.stack([c, -s * sign], -1), torch.stack([s, c * sign], -1)], -2)
        scale = self.log_scale.exp()[:, None, None]
        return scale * turn @ self.isohedral_class.stretch(self.stretch)

    def place(self, points: Tensor) -> Tensor:
        """Apply A o L to points (S, N, 2) of the group's frame."""
        return self._points(points) @ self.linear().mT + self.offset[:, None, :]

    def unplace(self, points: Tensor) -> Tensor:
        """Apply (A o L)^-1 to points (N, 2) or (S, N, 2) of the target's normal form."""
        return (self._points(points) - self.offset[:, None, :]) @ linalg.inv(self.linear()).mT

    def forward(self, points: Tensor) -> Tensor:
        """Apply D to points (S, N, 2) of the group's frame."""
        return self.place(self.flow(self._points(points)))

    def inverse(self, points: Tensor) -> Tensor:
        """Apply D^-1 to points (N, 2) or (S, N, 2) of the target's normal form."""
        return self.flow.inverse(self.unplace(points))

    def _points(self, points: Tensor | ArrayLike) -> Tensor:
        """Return `points` if they suit the model; arrays and lists become tensors of its dtype."""
        if not isinstance(points, Tensor):
            return torch.as_tensor(
                as_array(points, "points", (..., "N", 2), finite=False),
                dtype=self.angle.dtype,
                device=self.angle.device,
            )
        if points.dtype != self.angle.dtype:
            raise OrbiflowError(
                f"points are {points.dtype}, the model is {self.angle.dtype}: give points.to(...) or "
                "convert the model"
            )
        if points.ndim < 2 or points.shape[-1] != 2:
            raise OrbiflowError(f"points: expected shape (S, N, 2), got {tuple(points.shape)}")
        return points

    def prototile(self) -> tuple[Tensor, Tensor]:
        """Return what the flow starts from: vertices (S, N, 2) and the corners' indices (S, K)."""
        if self.vertices is None or self.corners is None:
            template = self.template()
            corners = torch.arange(template.shape[1], device=template.device)
            return template, corners.expand(len(template), -1)
        return self.vertices.to(self.angle.dtype), self.corners

    def take(self, indices: Sequence[int] | int) -> TileModel:
        """Return a new model with the candidates at `indices` only, at the same parameters."""
        several = indices if isinstance(indices, Sequence | np.ndarray) else [indices]
        chosen = [as_whole(i, "a candidate's index", 0, self.size - 1) for i in several]
        if not chosen:
            raise OrbiflowError(f"choose at least one of the {self.size} candidates")
        fields = [field.parameters_.detach()[chosen] for field in self.fourier_fields()]
        return self.with_fields(fields, chosen)

    @staticmethod
    @torch.no_grad()
    def joined(models: Sequence[TileModel]) -> TileModel:
        """Return the candidates of models of one class, different in parameters alone, as one stack."""
        names = {model.isohedral_class.name for model in models}
        if len(names) != 1:
            raise OrbiflowError(f"models of one class can be joined, got {sorted(names) or 'none'}")
        first = models[0]
        stack = first.take([0] * sum(model.size for model in models))
        parts = [dict(model.named_parameters()) for model in models]
        for name, parameter in stack.named_parameters():
            parameter.copy_(torch.cat([part[name] for part in parts]))
        stack.mirror = torch.cat([model.mirror for model in models])
        if first.vertices is not None and first.corners is not None:
            stack.vertices = torch.cat([m.vertices for m in models if m.vertices is not None])
            stack.corners = torch.cat([m.corners for m in models if m.corners is not None])
        return stack

    def fourier_fields(self) -> list[FourierField]:
        """Return the segments of the flow."""
        return [field for field in self.flow.segments if isinstance(field, FourierField)]

    @torch.no_grad()
    def with_fields(self, fields: list[Tensor], indices: list[int] | None = None) -> TileModel:
        """Return the candidates at `indices` (default: all), with a segment for each of the fields."""
        chosen = list(range(self.size)) if indices is None else indices
        model = TileModel(
            self.isohedral_class,
            np.zeros(len(chosen)),  # a fit that ran away has angles that none may begin with
            mirrored=self.mirror[chosen],
            max_frequency=self.max_frequency,
            segments=len(fields),
            smoothness=self.smoothness,
            steps=self.flow.steps,
            method=self.flow.method,
            dtype=self.angle.dtype,
        ).to(self.angle.device)
        for name in ("angle", "log_scale", "offset", "shape", "stretch"):
            getattr(model, name).copy_(getattr(self, name)[chosen])
        if self.vertices is not None and self.corners is not None:
            model.vertices = self.vertices[chosen].clone()
            model.corners = self.corners[chosen].clone()
        for field, parameters in zip(model.fourier_fields(), fields, strict=True):
            field.parameters_.copy_(parameters)
        return model

    def finished(self, index: int, *, force: bool = False) -> tuple[Tile, TileMap]:
        """Return the polygon of a candidate with its group, and the flow that made it."""
        tile, fine = extract_tile(self.take([index]), force=force)
        return tile, as_map(fine)

    def require_single(self) -> None:
        """Check that the model holds one candidate."""
        if self.size != 1:
            raise OrbiflowError(f"take one candidate first: this model holds {self.size}")

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Self:
        # what .float(), .half() and .to(...) go through: the start follows them to a device alone
        exact = {name: buffer for name, buffer in self._buffers.items() if buffer is not None}
        super()._apply(fn, recurse)  # pyright: ignore[reportUnknownMemberType]
        for name, buffer in exact.items():
            setattr(self, name, buffer.to(getattr(self, name).device))
        return self


def trainable(candidates: ClassCandidates) -> TileModel:
    """Return candidates as a torch module, to be trained: that of start tiles has a field of zero."""
    if isinstance(candidates, TileModel):
        return candidates
    if not isinstance(candidates, StillTiles):
        raise OrbiflowError("expected the candidates of a fit; see fit_tile")
    starts = candidates.prototiles
    return TileModel(candidates.kind, max_frequency=1, smoothness=0.0, steps=1, prototiles=starts)


def placed_field(model: TileModel) -> Callable[[Tensor], Tensor]:
    """Return a single candidate's field, the mean over time, in the target's normal form."""
    linear = model.linear().detach()[0]
    # fields are linear in their parameters: one evaluation for any number of segments
    parameters = torch.stack([segment.parameters_.detach() for segment in model.fourier_fields()])
    mean = model.with_fields([parameters.mean(dim=0)])

    @torch.no_grad()
    def field(points: Tensor) -> Tensor:
        flat = points.to(linear).reshape(1, -1, 2)
        return (mean.flow.segments[0](model.unplace(flat)) @ linear.mT).reshape(points.shape)

    return field


MAX_STEPS = 1024  # integration steps of a segment beyond which a field counts as too steep


@torch.no_grad()
def converge(
    model: TileModel, points: Tensor, *, tolerance: float = 1e-7, force: bool = False
) -> tuple[Tensor, float]:
    """Double the integration steps of a single candidate until the flow is accurate (design point 5).

    Returns the points (1, N, 2) carried at the doubled steps, and the error estimate. A field that is
    too steep is a `CertificationError`, unless `force` takes it at `MAX_STEPS`.
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
    """Return a single candidate's `simplest_tile`, in normal form, and the float64 model of it."""
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


def as_model(source: EscherTile | TileMap) -> TileModel:
    """Return the flow that made a tile: float64, one candidate, in the target's normal form.

    Raises:
        OrbiflowError: If no flow made it, or none is known.
    """
    stored = source.map if isinstance(source, EscherTile) else source
    if stored is None or not stored.has_flow:
        raise OrbiflowError(NO_FLOW)
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
            class_of(settings["class"]),
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
            parameter.copy_(torch.tensor(_checked(arrays, name, shape))[None])
    if VERTICES in arrays or CORNERS in arrays:
        vertices, corners = _prototile(arrays, len(model.template()[0]))
        model.vertices, model.corners = torch.tensor(vertices)[None], torch.tensor(corners)[None]
    return model


def load_model(path: str | Path) -> TileModel:
    """Read the flow of a `model.safetensors`: one candidate, float64, in the target's normal form.

    Raises:
        InputFileError: for a file that is missing, too large or not such a model, or without a flow.
    """
    stored = TileMap.read(path)
    if not stored.has_flow:
        raise InputFileError(f"{path}: {NO_FLOW}")
    with naming_file(path):
        return as_model(stored)


def _checked(arrays: dict[str, Array], name: str, shape: tuple[int | str, ...]) -> Array:
    return as_array(arrays.get(name, "nothing"), f"the model's {name}", shape)


def _prototile(arrays: dict[str, Array], count: int) -> tuple[Array, Array]:
    vertices = _checked(arrays, VERTICES, ("N", 2))
    corners = np.asarray(arrays.get(CORNERS, np.zeros(0)))
    as_whole(len(vertices), f"the number of rows of the model's {VERTICES}", count, MAX_SIDES)
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
