"""Errors that orbiflow raises for a user's mistake.

Every message says what was wrong, where, and what to do. All derive from `OrbiflowError`, which is
a `ValueError`, so one `except` catches them; the command line turns them into exit status 2.
"""


class OrbiflowError(ValueError):
    """Base of all errors caused by an argument, a file or a setting that cannot be used."""


class InputFileError(OrbiflowError):
    """A file that cannot be read as a silhouette or as data."""


class OutputError(OrbiflowError):
    """A result that cannot be written where it was asked for."""


class GroupError(OrbiflowError):
    """Generators and a lattice that do not make a crystallographic group."""


class NotAnIsometryError(GroupError):
    """A linear part that is not orthogonal."""


class LatticeMismatchError(GroupError):
    """A generator that does not map the lattice to itself."""


class NotDiscreteError(GroupError):
    """Generators whose closure modulo the lattice is not finite."""


class CertificationError(OrbiflowError):
    """A tile that does not tile the plane within the stated tolerance."""


class CoarseStepsWarning(UserWarning):
    """A flow whose integration steps are too coarse for its fields: its results are not accurate."""
