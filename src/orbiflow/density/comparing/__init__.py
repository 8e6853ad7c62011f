"""Comparing fitted densities, and data sets, with their uncertainty."""

from orbiflow.density.comparing.data_sets import DataComparison, compare_samples
from orbiflow.density.comparing.divergence import Divergence, Estimate
from orbiflow.density.comparing.models import (
    compare_models,
    density_of,
    require_one_space,
    scores_of,
)
from orbiflow.density.comparing.paired import (
    Difference,
    ModelComparison,
    ModelScore,
    compare_scores,
)
from orbiflow.density.comparing.rows import RowSketch
from orbiflow.density.comparing.splits import cross_validation_folds
from orbiflow.density.comparing.two_samples import TestResult, mmd_test

__all__ = [
    "DataComparison",
    "Difference",
    "Divergence",
    "Estimate",
    "ModelComparison",
    "ModelScore",
    "RowSketch",
    "TestResult",
    "compare_models",
    "compare_samples",
    "compare_scores",
    "cross_validation_folds",
    "density_of",
    "mmd_test",
    "require_one_space",
    "scores_of",
]
