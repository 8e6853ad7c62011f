"""p(data | covariates) as a mixture of parts, exactly normalised wherever the covariates are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Self

import numpy as np
import torch
from torch import Tensor

from orbiflow.density.models.circular_regression import CircularRegression
from orbiflow.density.models.conditional_kernels import ConditionalKernels
from orbiflow.density.models.conditional_parts import ConditionalPart
from orbiflow.density.models.density import Density
from orbiflow.density.models.headers import density_from, density_parts, within
from orbiflow.density.models.joint import JointDensity
from orbiflow.density.models.mixture import mixture_of
from orbiflow.density.models.neural_mixture import NeuralMixture
from orbiflow.density.spaces import CHART, Covariates, Space, Values
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import from_json, to_json
from orbiflow.typed_torch import listed


class Unconditional(ConditionalPart):
    """The density of all rows, whatever the covariates are.

    Args:
        density: That density.
    """

    kind = "all"

    def __init__(self, density: Density) -> None:
        self.space, self.density = density.space, density

    @torch.no_grad()
    def log_prob(self, points: Tensor, x: Tensor) -> Tensor:
        del x
        return self.density.log_prob(points)

    def at(self, x: Tensor) -> Density:
        del x
        return self.density

    def header(self) -> dict[str, Any]:
        return {"density": density_parts(self.density, "density")[0]}

    def tensors(self) -> dict[str, Tensor]:
        return density_parts(self.density, "density")[1]

    @classmethod
    def from_header(
        cls, space: Space, number: Tensor, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        del number
        return cls(density_from(space, header["density"], tensors))


PARTS: dict[str, type[ConditionalPart]] = {
    part.kind: part
    for part in (Unconditional, ConditionalKernels, NeuralMixture, CircularRegression, JointDensity)
}
"""What a conditional density may be made of, by kind."""


Context = Tensor | Mapping[str, Values]
"""What is known: features, or cells by the names of columns."""


class ConditionalDensity:
    """A mixture of conditional densities, exactly normalised wherever the covariates are.

    Args:
        covariates: The columns that are known.
        parts: Its parts, on one space.
        weights: Their weights (P,), above 0 and of sum 1.
    """

    def __init__(
        self, covariates: Covariates, parts: Sequence[ConditionalPart], weights: Sequence[float]
    ) -> None:
        self.covariates, self.parts, self.space = covariates, tuple(parts), parts[0].space
        self.weights = torch.tensor(weights, dtype=torch.float64)

    def context(self, given: Context) -> Tensor:
        """Return features (N, m) of what is known: features already, or cells by columns' names."""
        if isinstance(given, Mapping):
            given = self.covariates.features({k: np.atleast_1d(v) for k, v in given.items()})
        return given[None] if given.ndim == 1 else given

    @torch.no_grad()
    def log_prob(self, value: Tensor, context: Context, *, measure: str = CHART) -> Tensor:
        """Return log densities (N,) at chart points (N, d), each where its covariates are.

        Args:
            value: The points.
            context: Features (N, m) as `covariates.features` makes them, or cells (N,) by the columns'
                names; a single row is that of all points.
            measure: As for `Density.log_prob`.
        """
        x = self.context(context)
        x = x.expand(len(value), -1) if len(x) == 1 else x
        logs = torch.stack([part.log_prob(value, x) for part in self.parts])
        logs = (logs + self.weights.log()[:, None]).logsumexp(dim=0)
        return logs + self.space.log_density_factor(value, measure)

    def at(self, context: Context) -> Density:
        """Return the density where covariates are as one row says, a mixture that can be saved."""
        (x,) = self.context(context)
        weighted: list[tuple[float, Density]] = []
        for weight, part in zip(listed(self.weights), self.parts, strict=True):
            weighted += [(weight * share, density) for share, density in part.at(x).parts()]
        return mixture_of(weighted)

    def header(self) -> dict[str, Any]:
        """Return what makes the density again, together with `tensors`; ready for JSON."""
        parts = [{"kind": part.kind, **part.header()} for part in self.parts]
        return {"covariates": to_json(self.covariates), "parts": parts}

    def tensors(self) -> dict[str, Tensor]:
        """Return all tensors by name."""
        named = {"weights": self.weights}
        for number, part in enumerate(self.parts):
            tensors = part.tensors().items()
            named |= {f"{number}.{name}": tensor for name, tensor in tensors}
        return named

    @classmethod
    def from_header(
        cls, space: Space, header: Mapping[str, Any], tensors: Mapping[str, Tensor]
    ) -> Self:
        """Make the density again; raise `OrbiflowError` for what cannot be."""
        covariates = from_json(Covariates, header["covariates"], "covariates")
        parts = [
            PARTS[entry["kind"]].from_header(
                space, covariates.number, entry, within(tensors, f"{k}.")
            )
            for k, entry in enumerate(header["parts"])
        ]
        weights = tensors["weights"]
        if (
            not parts
            or tuple(weights.shape) != (len(parts),)
            or not bool((weights > 0).all())
            or abs(float(weights.sum()) - 1) > 1e-6
        ):
            raise OrbiflowError("weights that are none")
        return cls(covariates, parts, listed(weights))
