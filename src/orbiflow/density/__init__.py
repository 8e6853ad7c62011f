"""Densities on the torus, the sphere, the Klein bottle and the projective plane."""

from orbiflow.density.estimator import DensityEstimator
from orbiflow.density.fitting.flow import FitSettings, fit_density
from orbiflow.density.fitting.kernels import blend_kernels
from orbiflow.density.fitting.neural import NeuralSettings, fit_neural
from orbiflow.density.fitting.report import FitReport
from orbiflow.density.models.bases import Base, UniformBase, VonMisesBase
from orbiflow.density.models.blend import BlendedDensity
from orbiflow.density.models.chains import VonMisesChains
from orbiflow.density.models.kernels import AdaptiveKernels
from orbiflow.density.models.neural import NeuralField, NeuralFlow
from orbiflow.density.models.symmetric import SymmetricDensity, kl_by_quadrature, midpoints
from orbiflow.density.models.tabulated import TabulatedDensity
from orbiflow.density.spaces.catalogue import SPACES, make_space
from orbiflow.density.spaces.flat import KleinBottle, Torus
from orbiflow.density.spaces.patches import from_klein, to_klein
from orbiflow.density.spaces.round import (
    ProjectivePlane,
    Sphere,
    clear_rotation,
    to_latlon,
    to_vectors,
)
from orbiflow.density.spaces.space import MEASURES, Space
from orbiflow.density.storage.files import density_to_bytes, read_density

__all__ = [
    "MEASURES",
    "SPACES",
    "AdaptiveKernels",
    "Base",
    "BlendedDensity",
    "DensityEstimator",
    "FitReport",
    "FitSettings",
    "KleinBottle",
    "NeuralField",
    "NeuralFlow",
    "NeuralSettings",
    "ProjectivePlane",
    "Space",
    "Sphere",
    "SymmetricDensity",
    "TabulatedDensity",
    "Torus",
    "UniformBase",
    "VonMisesBase",
    "VonMisesChains",
    "blend_kernels",
    "clear_rotation",
    "density_to_bytes",
    "fit_density",
    "fit_neural",
    "from_klein",
    "kl_by_quadrature",
    "make_space",
    "midpoints",
    "read_density",
    "to_klein",
    "to_latlon",
    "to_vectors",
]
