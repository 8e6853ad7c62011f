"""Candidate tiles of one class: D = A o L o flow applied to the template (design points 6-8)."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor, nn

from orbiflow.errors import OrbiflowError
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

    Shapes:
        points (S, N, 2) throughout.
    """

    mirror: Tensor

    def __init__(
        self,
        isohedral_class: IsohedralClass,
        angles: Tensor,
        *,
        mirrored: Tensor | None = None,
        max_frequency: int = 10,
        segments: int = 1,
        smoothness: float = 1.0,
        steps: int = 8,
        method: str = "rk4",
        dtype: torch.dtype = torch.float64,
    ) -> None:
        super().__init__()
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
        self.flow = Flow(fields, steps=steps, method=method)
        self.max_frequency = max_frequency
        self.segments = segments
        self.smoothness = smoothness
        with torch.no_grad():  # the template's centre at the target's centroid
            linear = self.linear()
            center = self.template().mean(dim=-2, keepdim=True) @ linear.mT
            self.offset.copy_(-center[:, 0])

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

    def template_boundary(self, per_edge: int) -> Tensor:
        """Points (S, K per_edge, 2) along the template, evenly spaced on each edge.

        Even spacing makes the samples of identified edges correspond, whichever way they run.
        """
        corners = self.template()
        t = torch.linspace(0, 1, per_edge + 1, dtype=corners.dtype, device=corners.device)[
            :-1, None
        ]
        edges = corners.roll(-1, dims=-2) - corners
        return (corners[:, :, None] + t * edges[:, :, None]).flatten(1, 2)

    def take(self, indices: list[int]) -> TileModel:
        """A new model with the candidates at `indices` only, at the same parameters."""
        smaller = TileModel(
            self.isohedral_class,
            self.angle.detach()[indices],
            mirrored=self.mirror[indices],
            max_frequency=self.max_frequency,
            segments=self.segments,
            smoothness=self.smoothness,
            steps=self.flow.steps,
            method=self.flow.method,
            dtype=self.angle.dtype,
        ).to(self.angle.device)
        with torch.no_grad():
            own = dict(self.named_parameters())
            for name, parameter in smaller.named_parameters():
                parameter.copy_(own[name][indices])
        return smaller

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
