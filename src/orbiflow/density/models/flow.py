"""Densities carried by a flow whose field has the space's symmetry, and the bases that it carries."""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping
from typing import Any, Self

import torch
from torch import Tensor

from orbiflow.density.models.density import Density, Restriction, Split
from orbiflow.density.models.evaluation import midpoints
from orbiflow.density.models.headers import density_from, density_parts, within
from orbiflow.density.models.tensors import in_blocks
from orbiflow.density.spaces import Space
from orbiflow.errors import OrbiflowError
from orbiflow.flows import Flow, flow_from, flow_parts
from orbiflow.runtime import one_thread
from orbiflow.settings import as_instance
from orbiflow.typed_torch import linalg

MOST_DIM = 3
"""The most dimensions of a flow of splines, whose grid would be too large beyond."""


def flow_obstacle(space: Space) -> str | None:
    """Return why no density on a space has a flow, in words, or None."""
    if space.has_chart and space.dim <= MOST_DIM:
        return None
    return f"a flow has {MOST_DIM} dimensions at most, this {space.name} has {space.dimensions}"


BLOCK_POINTS = 65536
"""Points integrated at a time where no gradient is asked for: bounds the memory."""

CARRIED_POINTS = 4096
"""Points carried at a time together with the Jacobian of the carrying."""

FIRST_NODES, MOST_NODES = {1: 64, 2: 16}, {1: 512, 2: 64}
"""Nodes of each hidden angle at first and at most, by the number of hidden angles."""

SETTLED_NATS = 1e-7
"""Mean change, in nats, by twice as many nodes, below which there are enough."""


class FlowDensity(Density, kind="flow"):
    """The push-forward of a base by a symmetric flow (paper, section 5; design point 14).

    Args:
        space: The identification space.
        flow: The flow from the base to the data; its fields commute with `space.group`.
        base: Any density on the space; default: the uniform one.
    """

    article = "a flow"
    has_fine_detail = False
    is_carried = True

    def __init__(self, space: Space, flow: Flow, base: Density | None = None) -> None:
        super().__init__(space)
        self.flow = as_instance(flow, Flow, "flow")
        self.base = UniformDensity(space) if base is None else as_instance(base, Density, "base")

    @property
    def dtype(self) -> torch.dtype:
        """The dtype of the flow's parameters."""
        return self._like().dtype

    @property
    def device(self) -> torch.device | None:
        """The device of the flow's parameters."""
        return next((p.device for p in self.flow.parameters()), None)

    def drift(self, points: Tensor) -> Tensor:
        like = self._like()
        vectors = [field(points.to(like)) for field in self.flow.segments]
        return torch.stack(vectors).mean(dim=0).double().cpu()

    def log_chart(self, points: Tensor) -> Tensor:
        # flow, base and area are invariant: no need to project
        if torch.is_grad_enabled() or points[..., 0].numel() <= BLOCK_POINTS:
            return self._carried_back(points)
        return in_blocks(self._carried_back, points, BLOCK_POINTS)

    def _carried_back(self, points: Tensor) -> Tensor:
        start, log_det = self.flow.inverse_and_log_det(points)
        return self.base.log_chart(start) + log_det

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        start = self.base.draw(count, generator).to(self._like())
        if torch.is_grad_enabled():
            end = self.flow(start)
        else:
            end = torch.cat([self.flow(block) for block in torch.split(start, BLOCK_POINTS)])
        return self.space.project(end)

    @one_thread()
    @torch.no_grad()
    def mass(self, resolution: int = 64) -> float:
        """Return the integral over the space, by the midpoint rule on resolution^d points.

        The points are spread evenly over the base and carried by the flow, so that they crowd where
        the density is high, and each counts for the area that its surroundings are carried to: the
        Jacobian of the carrying, taken by automatic differentiation. What is off from 1 is the
        integrator's error: a plain grid of 512^2 misses 1 % of a density in sharp clusters.
        """
        grid = midpoints(self.space, resolution).to(self._like())
        parts = [self._carried_mass(block) for block in torch.split(grid, CARRIED_POINTS)]
        return float(torch.cat(parts).mean())

    def _carried_mass(self, start: Tensor) -> Tensor:
        with torch.enable_grad():
            start = start.requires_grad_()
            end = self.flow(start)
            rows = [
                torch.autograd.grad(end[:, k].sum(), start, retain_graph=True)[0]
                for k in range(self.space.dim)
            ]
        with torch.no_grad():
            # signed: a map that folds still covers the square once
            area = linalg.det(torch.stack(rows, dim=1))
            return self.log_chart(end.detach()).exp() * area

    def with_steps(self, steps: int) -> Self:
        """Return a view of the density with its flow integrated in other steps."""
        view = copy.copy(self)
        view.flow = self.flow.with_steps(steps)
        return view

    def log_marginal(self, points: Tensor, axes: list[int], seed: int = 0) -> Tensor:
        """Integrate the other angles by the trapezoidal rule, which converges exponentially here.

        Nodes are doubled until they change nothing.
        """
        del seed
        hidden = [axis for axis in range(self.space.dim) if axis not in axes]
        if len(hidden) > 2:
            raise OrbiflowError(
                f"a flow's density cannot be integrated over {len(hidden)} angles: fit without it, "
                'with components="kernels,mixture,chains"'
            )
        if not hidden:
            return self._at_nodes(points, axes, hidden, points.new_zeros(1, 0))[:, 0]
        count, last = FIRST_NODES[len(hidden)], points.new_full((len(points),), math.inf)
        while True:
            lines = [torch.arange(count, dtype=torch.float64) / count for _ in hidden]
            nodes = torch.cartesian_prod(*lines).reshape(-1, len(hidden))
            now = self._at_nodes(points, axes, hidden, nodes).logsumexp(dim=1)
            now -= math.log(len(nodes))
            settled = float((now - last).abs().mean()) < SETTLED_NATS
            if settled or count >= MOST_NODES[len(hidden)]:
                return now
            count, last = 2 * count, now

    def _at_nodes(
        self, points: Tensor, observed: list[int], hidden: list[int], nodes: Tensor
    ) -> Tensor:
        """Return log densities (N, Q) of all angles, each point at each node."""
        parts: list[Tensor] = []
        for block in torch.split(points.double(), max(1, BLOCK_POINTS // len(nodes))):
            whole = block.new_empty(len(block), len(nodes), self.space.dim)
            whole[:, :, observed] = block[:, None]
            whole[:, :, hidden] = nodes
            with torch.no_grad():
                parts.append(self.log_prob(whole))
        return torch.cat(parts)

    def header(self) -> dict[str, Any]:
        return {
            "flow": flow_parts(self.flow, with_own=False)[0],
            "base": density_parts(self.base, "base", space=self.space)[0],
        }

    def tensors(self) -> dict[str, Tensor]:
        named = {f"flow.{name}": tensor for name, tensor in self.flow.state_dict().items()}
        return named | density_parts(self.base, "base", "base.")[1]

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        flow = flow_from(header["flow"], within(tensors, "flow."), {})
        return cls(space, flow, density_from(space, header["base"], within(tensors, "base.")))

    def _like(self) -> Tensor:
        return next(iter(self.flow.parameters()), torch.zeros((), dtype=torch.float64))

    def __repr__(self) -> str:
        return f"FlowDensity({self.space!r}, {type(self.base).__name__}, {self.flow})"


class UniformDensity(Density, kind="uniform"):
    """The uniform density in natural measure: on sphere and projective plane J / 4 pi and J / 2 pi.

    An equivariant flow fixes the cone points, so a base that is flat in the chart could never be
    corrected there (design point 13). As a component it keeps a lone observation from being
    impossible.
    """

    @property
    def log_floor(self) -> float:
        round_parts = (part for part in self.space.parts or (self.space,) if part.is_round)
        return -sum(math.log(part.volume) for part in round_parts)

    def log_density(self, points: Tensor, beside: float = -math.inf) -> Tensor:
        del beside
        return self.log_floor + 0 * points[..., 0]  # which has gradients

    def draw(self, count: int, generator: torch.Generator) -> Tensor:
        return self.space.uniform(count, generator)

    def restricted(self, split: Split, space: Space) -> Restriction:
        evidence = 0.0
        if split.given and self.space.parts:
            at = torch.tensor([split.values], dtype=torch.float64)
            evidence = float(self.log_marginal(at, list(split.given)))
        return Restriction([(evidence, UniformDensity(space))], [])
