"""Densities of some of a torus' angles: marginal, conditional, at rows that lack angles."""

from orbiflow.density.partial.derived import conditional, marginal
from orbiflow.density.partial.observed import log_prob_observed

__all__ = ["conditional", "log_prob_observed", "marginal"]
