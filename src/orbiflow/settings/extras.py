"""Packages that only a part of orbiflow needs, and doors of rooms that say so where one is missing."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import contextmanager
from traceback import walk_tb
from typing import Any

import lazy_loader

from orbiflow.errors import OrbiflowError

EXTRAS = {
    "torch": "flows",
    "matplotlib": "density",
    "contourpy": "density",
    "pandas": "density",
    "starlette": "studio",
    "uvicorn": "studio",
    "gemmi": "crystals",
    "skimage": "solids",
    "trimesh": "solids",
    "pyarrow": "parquet",
    "distributed": "dask",
}
"""The extra that brings each package."""

WINGS = {"orbiflow.density": ("flows", "density"), "orbiflow.solids": ("crystals", "solids")}
"""Rooms whose own extra, the second one, brings what the first one has as well."""


class MissingExtraError(OrbiflowError, ImportError):
    """A package of an extra that is not installed.

    - `who`, `package`, `extra`: Who needs it, its name, and the extra that brings it.
    """

    def __init__(self, who: str, package: str, extra: str) -> None:
        super().__init__(
            f"{who} needs {package}, which is not installed: pip install 'orbiflow[{extra}]'"
        )
        self.who, self.package, self.extra = who, package, extra


@contextmanager
def naming_extras(who: str) -> Generator[None]:
    """Say in one line which extra to install where a block imports a package that is not there.

    Of blocks within one another the outer one is named instead of a name within orbiflow.

    Raises:
        MissingExtraError: If a package of one of the `EXTRAS` is not installed.
    """
    try:
        yield
    except MissingExtraError as error:
        if not error.who.startswith("orbiflow."):
            raise
        raise MissingExtraError(who, error.package, error.extra) from error
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        rooms = [frame.f_globals.get("__name__", "") for frame, _ in walk_tb(error.__traceback__)]
        extra = EXTRAS[package]
        for wing, (part, whole) in WINGS.items():
            if extra == part and any(room.startswith(wing) for room in rooms):
                extra = whole
        raise MissingExtraError(who, package, extra) from error


def door(name: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and `__all__` of a package, whose stub names what it exports.

    A name is imported when it is first used (PEP 562).
    """
    get, names, public = lazy_loader.attach_stub(name, file)

    def found(attribute: str) -> Any:
        with naming_extras(f"{name}.{attribute}"):
            return get(attribute)

    return found, names, public
