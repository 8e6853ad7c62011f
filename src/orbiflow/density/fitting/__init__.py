"""Fitting densities to points."""
