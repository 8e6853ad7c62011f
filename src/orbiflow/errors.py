"""The errors that orbiflow raises for a user's mistake.

Every message says what is wrong, where, and what to do. All are kinds of `OrbiflowError`, a
`ValueError`, so one `except` catches them; the command line ends with exit status 2.
"""

import re
from collections.abc import Callable, Generator
from contextlib import contextmanager
from typing import Any, Self

NAME_IN_BRACES = re.compile(r"(?<!\{)\{(\w+)\}(?!\})")


class OrbiflowError(ValueError):
    """An argument, a file or a setting that cannot be used: the base of all other errors."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return how worker processes hand the error over, whatever it was made of."""
        return BaseException.__new__, (type(self), *self.args), self.__dict__


def with_names(template: str, named: Callable[[str], str]) -> str:
    """Return a text with each name in single braces called what a function returns for it."""
    text = NAME_IN_BRACES.sub(lambda match: named(match[1]), template)
    return text.replace("{{", "{").replace("}}", "}")


class Advice(str):
    """A text that names settings: by their own names, or what a command or a page calls them.

    >>> advice = Advice("try another {threshold}")
    >>> advice, advice.named(lambda name: "--" + name)
    ('try another threshold', 'try another --threshold')
    """

    template: str

    def __new__(cls, template: str) -> Self:
        made = super().__new__(cls, with_names(template, str))
        made.template = template
        return made

    def named(self, name: Callable[[str], str]) -> str:
        """Return the text with each setting called what `name` returns for it."""
        return with_names(self.template, name)


def advice_of(error: Exception) -> str:
    """Return the message of an error: an `Advice` where it names settings.

    >>> advice_of(InputFileError(Advice("too dark: try another {threshold}")))
    'too dark: try another threshold'
    """
    if isinstance(error, SettingError):
        return Advice(error.template)
    first = error.args[0] if error.args else ""
    return first if isinstance(first, Advice) else str(error)


class SettingError(OrbiflowError):
    """A setting or an argument that cannot be used.

    Args:
        template: The message, with the names of settings in braces, such as "{dpi} must be above 0".
            Any other text that may hold braces goes through `literal` first.

    >>> error = SettingError("{tile_size} must be above 0")
    >>> str(error), error.named(lambda name: "--" + name.replace("_", "-"))
    ('tile_size must be above 0', '--tile-size must be above 0')
    >>> error.about
    'tile_size'
    """

    def __init__(self, template: str) -> None:
        super().__init__(template)
        self.template = template

    def __str__(self) -> str:
        return self.named(str)

    @property
    def about(self) -> str:
        """The first setting that the message names, "" if it names none."""
        match = NAME_IN_BRACES.search(self.template)
        return match[1] if match else ""

    def named(self, name: Callable[[str], str]) -> str:
        """Return the message, with each setting called what `name` returns for it."""
        return with_names(self.template, name)


def literal(text: str) -> str:
    """Return `text` as it must be written in the template of a `SettingError`."""
    return text.replace("{", "{{").replace("}", "}}")


class InputFileError(OrbiflowError):
    """A file that cannot be read as a silhouette or as data."""


class OutputError(OrbiflowError):
    """A result that cannot be written to the requested place."""


@contextmanager
def system_errors(kind: type[OrbiflowError], what: str, cure: str = "") -> Generator[None]:
    """Raise what the system refuses in a block as an error of this kind: what failed, why, the cure.

    >>> with system_errors(InputFileError, "cannot read it", "check its name"):
    ...     open("no such file")
    Traceback (most recent call last):
    orbiflow.errors.InputFileError: cannot read it: No such file or directory; check its name
    """
    try:
        yield
    except OSError as error:
        more = f"; {cure}" if cure else ""
        raise kind(f"{what}: {error.strerror or error}{more}") from error


class GroupError(OrbiflowError):
    """Generators and a lattice that do not make a crystallographic group."""


class NotAnIsometryError(GroupError):
    """A linear part that is not orthogonal."""


class LatticeMismatchError(GroupError):
    """A generator that does not map the lattice to itself."""


class NotDiscreteError(GroupError):
    """Generators whose closure modulo the lattice is not finite."""


class CertificationError(SettingError):
    """A tile that does not tile the plane within the stated tolerance, and is not forced."""


class DataWarning(UserWarning):
    """Data that may not be what they were taken for, or of which something was decided for the user."""


class CoarseStepsWarning(UserWarning):
    """A flow whose integration steps are too coarse for its fields: its results are not accurate."""


class RoundedOperatorsWarning(UserWarning):
    """Operators of a group with rounded shifts, such as 0.3333: they are read as simple fractions."""
