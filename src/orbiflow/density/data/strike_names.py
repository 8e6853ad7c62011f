"""Which columns are strikes of planes, or the directions in which they dip, by their names."""

from __future__ import annotations

from collections.abc import Sequence

from orbiflow.density.data.column_names import words_of


def strike_beside_dip(names: Sequence[str]) -> int | None:
    """Return the column, from 0, of a strike if the columns are a dip and a strike.

    >>> strike_beside_dip(["dip", "strike (deg)"]), strike_beside_dip(["dip", "dipdir"])
    (1, None)
    """
    split = [{"dip", "strike"}.intersection(words_of(name)) for name in names]
    strike = {"strike"}
    return split.index(strike) if split in ([{"dip"}, strike], [strike, {"dip"}]) else None


def dip_direction_among(wanted: str, names: Sequence[str]) -> str | None:
    """Return the column that has the direction of dip, or else the strike, if that is `wanted`.

    >>> dip_direction_among("dip_direction", ["dip", "DipDir"])
    'DipDir'
    >>> dip_direction_among("dipdir", ["strike", "dip"]), dip_direction_among("lat", ["strike", "dip"])
    ('strike', None)
    """
    lower = {name.casefold() for name in names}
    if words_of(wanted) != ["dipdir"] or wanted.casefold() in lower:
        return None
    for word in ("dipdir", "strike"):
        found = [name for name in names if word in words_of(name)]
        if found:
            return found[0] if len(found) == 1 else None
    return None
