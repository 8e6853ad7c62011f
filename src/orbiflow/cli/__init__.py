"""The command line: one thin command a task."""

from orbiflow.cli.app import main

__all__ = ["main"]
