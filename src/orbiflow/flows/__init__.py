"""Integrators and flows: diffeomorphisms from vector fields."""

from orbiflow.flows.flow import Flow
from orbiflow.flows.integrators import METHODS, RungeKutta

__all__ = ["METHODS", "Flow", "RungeKutta"]
