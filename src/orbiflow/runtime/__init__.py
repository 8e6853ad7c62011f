"""What runs operations of any wing: their signatures, command lines and JSON forms."""

from orbiflow.runtime.operations import (
    SCHEMA_VERSION,
    Call,
    Operation,
    Outcome,
    Sink,
    all_operations,
    call_from_json,
    find,
    ignore,
    operation,
)

__all__ = [
    "SCHEMA_VERSION",
    "Call",
    "Operation",
    "Outcome",
    "Sink",
    "all_operations",
    "call_from_json",
    "find",
    "ignore",
    "operation",
]
