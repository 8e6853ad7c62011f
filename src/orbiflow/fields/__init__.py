"""Vector fields with symmetry: Fourier fields, and the symmetrization of any field."""

from orbiflow.fields.derivatives import divergence, jacobian
from orbiflow.fields.fourier import FourierField
from orbiflow.fields.invariant_field import InvariantField
from orbiflow.fields.neural import PeriodicFeatures, neural_field
from orbiflow.fields.protocol import TimeDependentField, VectorField, time_dependent
from orbiflow.fields.spline_field import SplineField
from orbiflow.fields.symmetrize import (
    Symmetrized,
    periodic_operator,
    rotation_operator,
    symmetrize,
    transflection_operator,
)
from orbiflow.fields.torus_network import NeuralTorusField

__all__ = [
    "FourierField",
    "InvariantField",
    "NeuralTorusField",
    "PeriodicFeatures",
    "SplineField",
    "Symmetrized",
    "TimeDependentField",
    "VectorField",
    "divergence",
    "jacobian",
    "neural_field",
    "periodic_operator",
    "rotation_operator",
    "symmetrize",
    "time_dependent",
    "transflection_operator",
]
