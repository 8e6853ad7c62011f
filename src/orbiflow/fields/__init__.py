"""Vector fields with symmetry: Fourier fields, and the symmetrization of any field."""

from orbiflow.fields.derivatives import divergence, jacobian
from orbiflow.fields.fourier import FourierField
from orbiflow.fields.invariant_field import InvariantField
from orbiflow.fields.neural import PeriodicFeatures, neural_field
from orbiflow.fields.spline_field import SplineField
from orbiflow.fields.symmetrize import (
    Symmetrized,
    VectorField,
    periodic_operator,
    rotation_operator,
    symmetrize,
    transflection_operator,
)

__all__ = [
    "FourierField",
    "InvariantField",
    "PeriodicFeatures",
    "SplineField",
    "Symmetrized",
    "VectorField",
    "divergence",
    "jacobian",
    "neural_field",
    "periodic_operator",
    "rotation_operator",
    "symmetrize",
    "transflection_operator",
]
