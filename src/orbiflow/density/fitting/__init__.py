"""Fitting densities: closed-form start, likelihood, kernels, and what is reported of it."""

from orbiflow.density.fitting.automatic import AutomaticSettings, fit_automatic
from orbiflow.density.fitting.chains import ChainsFit, fit_chains
from orbiflow.density.fitting.flow import fit_density
from orbiflow.density.fitting.kernels import blend_kernels
from orbiflow.density.fitting.likelihood import Refinement
from orbiflow.density.fitting.neural import NeuralSettings, fit_neural
from orbiflow.density.fitting.report import FitReport, Progress
from orbiflow.density.fitting.settings import FitSettings

__all__ = [
    "AutomaticSettings",
    "ChainsFit",
    "FitReport",
    "FitSettings",
    "NeuralSettings",
    "Progress",
    "Refinement",
    "blend_kernels",
    "fit_automatic",
    "fit_chains",
    "fit_density",
    "fit_neural",
]
