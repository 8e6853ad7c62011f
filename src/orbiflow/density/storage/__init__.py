"""Densities on disk: safetensors, never pickle."""
