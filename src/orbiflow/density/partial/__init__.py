"""Densities of some of a torus' angles: marginal, conditional, at rows that lack angles."""

from orbiflow.density.partial.derived import conditional, marginal
from orbiflow.density.partial.kernels import log_kernels
from orbiflow.density.partial.named import axes_named, chart_of_observed, given_named
from orbiflow.density.partial.observed import at_observed, log_prob_observed

__all__ = [
    "at_observed",
    "axes_named",
    "chart_of_observed",
    "conditional",
    "given_named",
    "log_kernels",
    "log_prob_observed",
    "marginal",
]
