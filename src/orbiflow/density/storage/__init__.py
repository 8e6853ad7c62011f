"""Densities on disk: safetensors, never pickle."""

from orbiflow.density.storage.files import density_to_bytes, read_density

__all__ = ["density_to_bytes", "read_density"]
