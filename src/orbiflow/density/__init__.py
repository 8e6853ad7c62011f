"""Densities on the torus, the sphere, the Klein bottle and the projective plane."""

from orbiflow.density.bases import Base, UniformBase, VonMisesBase
from orbiflow.density.density import SymmetricDensity, kl_by_quadrature, midpoints
from orbiflow.density.estimator import SPACES, DensityEstimator, make_space
from orbiflow.density.fit import FitSettings, fit_density
from orbiflow.density.fit_neural import NeuralSettings, fit_neural
from orbiflow.density.fit_report import FitReport
from orbiflow.density.flat_spaces import KleinBottle, Torus
from orbiflow.density.kernel_fit import mix_kernels
from orbiflow.density.kernels import AdaptiveKernels
from orbiflow.density.mixed import MixedDensity
from orbiflow.density.mixture import MixtureBase
from orbiflow.density.neural import NeuralFlow, NeuralTorusField
from orbiflow.density.patches import from_klein, to_klein
from orbiflow.density.round_spaces import (
    ProjectivePlane,
    Sphere,
    clear_rotation,
    to_latlon,
    to_vectors,
)
from orbiflow.density.space import MEASURES, Space
from orbiflow.density.storage import density_to_bytes, read_density
from orbiflow.density.tabulated import TabulatedDensity

__all__ = [
    "MEASURES",
    "SPACES",
    "AdaptiveKernels",
    "Base",
    "DensityEstimator",
    "FitReport",
    "FitSettings",
    "KleinBottle",
    "MixedDensity",
    "MixtureBase",
    "NeuralFlow",
    "NeuralSettings",
    "NeuralTorusField",
    "ProjectivePlane",
    "Space",
    "Sphere",
    "SymmetricDensity",
    "TabulatedDensity",
    "Torus",
    "UniformBase",
    "VonMisesBase",
    "clear_rotation",
    "density_to_bytes",
    "fit_density",
    "fit_neural",
    "from_klein",
    "kl_by_quadrature",
    "make_space",
    "midpoints",
    "mix_kernels",
    "read_density",
    "to_klein",
    "to_latlon",
    "to_vectors",
]
