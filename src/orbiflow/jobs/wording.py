"""Numbers in notes: in as many digits as say something."""

from __future__ import annotations

import math


def with_error(value: float, error: float) -> str:
    """A number and its standard error, in two digits of the error, four decimals at least.

    >>> with_error(0.5, 0.00354), with_error(0.9999, 0.00001)
    ('0.5000 ± 0.0035', '0.999900 ± 0.000010')
    """
    decimals = 4 if error <= 0 else max(4, 1 - math.floor(math.log10(error)))
    return f"{value:.{decimals}f} ± {error:.{decimals}f}"


def percentage(share: float) -> str:
    """A share in percent, two decimals or, where these would say nothing, two digits.

    >>> percentage(0.0218), percentage(0.0000123), percentage(0.0)
    ('2.18%', '0.0012%', '0.00%')
    """
    percents = 100 * share
    if percents <= 0 or percents >= 0.1:
        return f"{percents:.2f}%"
    return f"{percents:.{1 - math.floor(math.log10(percents))}f}%"


def counted(count: int, noun: str) -> str:
    """
    >>> counted(1, "row"), counted(3, "row")
    ('1 row', '3 rows')
    """
    return f"{count} {noun}{'s' * (count != 1)}"
