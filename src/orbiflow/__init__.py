"""Diffeomorphisms that commute with a crystallographic group."""

__version__ = "0.1.0"
