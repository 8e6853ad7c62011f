"""Densities: push-forwards of a base, kernels, chains, networks and their blends."""

from orbiflow.density.models.bases import Base, UniformBase, VonMisesBase
from orbiflow.density.models.blend import BlendedDensity
from orbiflow.density.models.chains import VonMisesChains
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.network import Factor, VonMisesNetwork
from orbiflow.density.models.neural import NeuralFlow, NeuralTorusField
from orbiflow.density.models.symmetric import SymmetricDensity, kl_by_quadrature, midpoints
from orbiflow.density.models.tabulated import TabulatedDensity

__all__ = [
    "AdaptiveKernels",
    "Base",
    "BlendedDensity",
    "Factor",
    "NeuralFlow",
    "NeuralTorusField",
    "SymmetricDensity",
    "TabulatedDensity",
    "UniformBase",
    "VonMisesBase",
    "VonMisesChains",
    "VonMisesNetwork",
    "kl_by_quadrature",
    "midpoints",
]
