"""Candidate tiles of one class: D = A o L o flow applied to the template (design points 6-8)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
from orbiflow.escher.prototiles import Prototiles
from orbiflow.fields import FourierField
from orbiflow.flows import Flow
from orbiflow.symmetry import CrystallographicGroup
from orbiflow.symmetry.isometry import Array
from orbiflow.tilings import IsohedralClass


class TileModel(nn.Module):
    """A stack of S candidate tiles of one isohedral class, in the target's normal form.

    The flow commutes with the class's group in the group's own frame; the lattice freedom L and the
    similarity A come after it, composed and not mixed in: the paper's V_sym(A^-1 z) loses the glide
    reflections as soon as A rotates (design point 6). A template of area 1 is the start.

    Args:
        isohedral_class: of all S tiles.
        angles: (S,) turn of each start, in radians.
        mirrored: (S,) whether A reverses orientation; default no.
        max_frequency: Omega of the fields.
        segments: stationary pieces of the flow.
        smoothness: Sobolev exponent of the fields' parameters.
        steps, method: of the integrator.
        dtype: of all parameters.
        prototiles: S start tiles with their poses, in place of the template; `angles` and `mirrored`
            are then taken from them.

    Shapes:
        points (S, N, 2) throughout.
    """

    mirror: Tensor
    outline: Tensor | None
    corners: Tensor | None

    def __init__(
        self,
        isohedral_class: IsohedralClass,
        angles: Tensor | None = None,
        *,
        mirrored: Tensor | None = None,
        max_frequency: int = 10,
        segments: int = 1,
        smoothness: float = 1.0,
        steps: int = 8,
        method: str = "rk4",
        dtype: torch.dtype = torch.float64,
        prototiles: Prototiles | None = None,
    ) -> None:
        super().__init__()
        if prototiles is not None:
            angles = torch.as_tensor(prototiles.angle)
            mirrored = torch.as_tensor(prototiles.mirrored)
        if angles is None:
            raise OrbiflowError("a tile model needs angles or prototiles")
        size = len(angles)
        self.isohedral_class = isohedral_class
        self.group: CrystallographicGroup = isohedral_class.group()
        area = self.group.cell_volume / self.group.order
        self.angle = nn.Parameter(angles.to(dtype).clone())
        self.log_scale = nn.Parameter(torch.full((size,), -0.5 * math.log(area), dtype=dtype))
        self.offset = nn.Parameter(torch.zeros(size, 2, dtype=dtype))
        self.shape = nn.Parameter(torch.zeros(size, isohedral_class.shape_dim, dtype=dtype))
        self.stretch = nn.Parameter(torch.zeros(size, isohedral_class.stretch_dim, dtype=dtype))
        flips = torch.zeros(size, dtype=torch.bool) if mirrored is None else mirrored.clone()
        self.register_buffer("mirror", flips)
        fields = [
            FourierField(self.group, max_frequency, batch=size, smoothness=smoothness, dtype=dtype)
            for _ in range(segments)
        ]
        self.flow = Flow(fields, steps=steps, method=method, warn=False)
        self.max_frequency = max_frequency
        self.segments = segments
        self.smoothness = smoothness
        self._start_from(prototiles)

    @torch.no_grad()
    def _start_from(self, prototiles: Prototiles | None) -> None:
        if prototiles is None:
            self.register_buffer("outline", None)
            self.register_buffer("corners", None)
            self.recentre()
            return
        # float64 whatever the parameters are: its edges match to rounding
        self.register_buffer("outline", torch.tensor(prototiles.outline, dtype=torch.float64))
        self.register_buffer("corners", torch.tensor(prototiles.corners))
        for name in ("log_scale", "offset", "stretch"):
            getattr(self, name).copy_(torch.as_tensor(getattr(prototiles, name)))

    @property
    def size(self) -> int:
        """Number S of candidates."""
        return len(self.angle)

    def template(self) -> Tensor:
        """Vertices (S, K, 2) of each candidate's template."""
        return self.isohedral_class.template(self.shape)

    def linear(self) -> Tensor:
        """The linear part of A o L, (S, 2, 2)."""
        c, s = self.angle.cos(), self.angle.sin()
        sign = torch.where(self.mirror, -1.0, 1.0).to(c.dtype)
        turn = torch.stack([torch.stack([c, -s * sign], -1), torch.stack([s, c * sign], -1)], -2)
        return (
            self.log_scale.exp()[:, None, None] * turn @ self.isohedral_class.stretch(self.stretch)
        )

    @torch.no_grad()
    def recentre(self) -> None:
        """Put each template's centre at the target's centroid, by the offset."""
        center = self.template().mean(dim=-2, keepdim=True) @ self.linear().mT
        self.offset.copy_(-center[:, 0])

    def place(self, points: Tensor) -> Tensor:
        """A o L at points (S, N, 2) of the group's frame."""
        return points @ self.linear().mT + self.offset[:, None, :]

    def unplace(self, points: Tensor) -> Tensor:
        """(A o L)^-1 at points (N, 2) or (S, N, 2) of the target's normal form."""
        return (points - self.offset[:, None, :]) @ torch.linalg.inv(self.linear()).mT

    def forward(self, points: Tensor) -> Tensor:
        """D at points (S, N, 2) of the group's frame."""
        return self.place(self.flow(points))

    def inverse(self, points: Tensor) -> Tensor:
        """D^-1 at points (N, 2) or (S, N, 2) of the target's normal form."""
        return self.flow.inverse(self.unplace(points))

    def prototile(self) -> tuple[Tensor, Tensor]:
        """What the flow starts from: vertices (S, N, 2) and the corners' indices (S, K)."""
        if self.outline is None or self.corners is None:
            template = self.template()
            corners = torch.arange(template.shape[1], device=template.device)
            return template, corners.expand(len(template), -1)
        return self.outline.to(self.angle.dtype), self.corners

    def boundary(self, pieces: int) -> Tensor:
        """Points (S, N pieces, 2) along the prototile, `pieces` evenly spaced on each side.

        Identified edges have as many sides each, so their samples correspond.
        """
        vertices, _ = self.prototile()
        t = torch.arange(pieces, dtype=vertices.dtype, device=vertices.device)[:, None] / pieces
        sides = vertices.roll(-1, dims=-2) - vertices
        return (vertices[:, :, None] + t * sides[:, :, None]).flatten(1, 2)

    def take(self, indices: list[int]) -> TileModel:
        """A new model with the candidates at `indices` only, at the same parameters."""
        fields = [field.parameters_.detach()[indices] for field in self.fourier_fields()]
        return self.with_fields(fields, indices)

    @staticmethod
    @torch.no_grad()
    def joined(models: Sequence[TileModel]) -> TileModel:
        """The candidates of models that differ in their parameters alone, as one stack."""
        first = models[0]
        stack = first.take([0] * sum(model.size for model in models))
        parts = [dict(model.named_parameters()) for model in models]
        for name, parameter in stack.named_parameters():
            parameter.copy_(torch.cat([part[name] for part in parts]))
        stack.mirror = torch.cat([model.mirror for model in models])
        if first.outline is not None and first.corners is not None:
            stack.outline = torch.cat([m.outline for m in models if m.outline is not None])
            stack.corners = torch.cat([m.corners for m in models if m.corners is not None])
        return stack

    def fourier_fields(self) -> list[FourierField]:
        """The segments of the flow."""
        return [field for field in self.flow.segments if isinstance(field, FourierField)]

    @torch.no_grad()
    def with_fields(self, fields: list[Tensor], indices: list[int] | None = None) -> TileModel:
        """The candidates at `indices` (default all) with another flow: one segment for each field.

        Args:
            fields: parameters (len(indices), P) of each segment, under this model's smoothness.
            indices: of the candidates.
        """
        chosen = list(range(self.size)) if indices is None else indices
        model = TileModel(
            self.isohedral_class,
            self.angle.detach()[chosen],
            mirrored=self.mirror[chosen],
            max_frequency=self.max_frequency,
            segments=len(fields),
            smoothness=self.smoothness,
            steps=self.flow.steps,
            method=self.flow.method,
            dtype=self.angle.dtype,
        ).to(self.angle.device)
        for name in ("log_scale", "offset", "shape", "stretch"):
            getattr(model, name).copy_(getattr(self, name)[chosen])
        if self.outline is not None and self.corners is not None:
            model.outline = self.outline[chosen].clone()
            model.corners = self.corners[chosen].clone()
        for own, parameters in zip(model.fourier_fields(), fields, strict=True):
            own.parameters_.copy_(parameters)
        return model

    def placed_group(self) -> CrystallographicGroup:
        """The group of a single candidate's tile, in the target's normal form.

        Raises:
            OrbiflowError: if the model holds more than one candidate.
        """
        if self.size != 1:
            raise OrbiflowError(f"take one candidate first: this model holds {self.size}")
        linear: Array = self.linear().detach().double().numpy()[0]
        offset: Array = self.offset.detach().double().numpy()[0]
        return self.group.conjugate(linear, np.asarray(offset))
