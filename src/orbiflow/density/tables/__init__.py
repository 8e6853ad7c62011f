"""Tables of numbers in CSV, TSV, whitespace-separated text, `.npy` and Parquet files."""

from orbiflow.settings import door

__getattr__, __dir__, __all__ = door(__name__, __file__)
