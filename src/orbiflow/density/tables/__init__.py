"""Tables of numbers in CSV, TSV, whitespace-separated text, `.npy` and Parquet files."""

from orbiflow.density.tables.files import append_column, read_table, to_csv
from orbiflow.density.tables.identifiers import is_identifier
from orbiflow.density.tables.table import Table

__all__ = ["Table", "append_column", "is_identifier", "read_table", "to_csv"]
