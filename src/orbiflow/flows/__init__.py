"""Integrators and flows: diffeomorphisms from vector fields."""

from orbiflow.flows.flow import Flow
from orbiflow.flows.integrators import METHODS, RungeKutta
from orbiflow.flows.storage import load_flow, save_flow

__all__ = ["METHODS", "Flow", "RungeKutta", "load_flow", "save_flow"]
