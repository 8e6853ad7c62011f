"""Densities: push-forwards of a base, kernels, chains and their blends."""
