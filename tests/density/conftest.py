"""Fits of all tests of densities try less, but for those that ask for `whole_fits`."""

from density.quick_fits import quick_fits_fixture, whole_fits_fixture  # noqa: F401
