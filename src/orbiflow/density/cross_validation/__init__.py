"""Cross-validation: how well a density predicts rows that its fit has not seen."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
