"""Tables of numbers in CSV, TSV, whitespace-separated text, `.npy` and Parquet files."""

from orbiflow.density.tables.files import append_column, append_columns, read_table, to_csv
from orbiflow.density.tables.identifiers import is_identifier
from orbiflow.density.tables.labels import column_names, read_labels
from orbiflow.density.tables.table import MissingCellsError, Table

__all__ = [
    "MissingCellsError",
    "Table",
    "append_column",
    "append_columns",
    "column_names",
    "is_identifier",
    "read_labels",
    "read_table",
    "to_csv",
]
