"""Routes of machines with their materials, which are kept for all projects and for the command line."""

from __future__ import annotations

from typing import Any

from orbiflow.studio.routes import JsonObject, Routes, Studio

routes = Routes()


@routes("GET", "/profiles")
def profiles(here: Studio) -> dict[str, Any]:
    """Return the names of the `settings` that a profile may hold, and the profiles that are `kept`."""
    from orbiflow.tiles import OF_MACHINE, Profiles

    del here
    return {"settings": OF_MACHINE, "kept": Profiles().read()}


@routes("PUT", "/profiles")
def keep(body: JsonObject, here: Studio, name: str = "") -> dict[str, Any]:
    """Keep settings under a name, and return it beside what `profiles` does."""
    from orbiflow.tiles import Profiles

    title = Profiles().keep(name, body)
    return {**profiles(here), "name": title}


@routes("DELETE", "/profiles")
def forget(here: Studio, name: str = "") -> dict[str, Any]:
    """Remove a profile."""
    from orbiflow.tiles import Profiles

    Profiles().forget(name)
    return profiles(here)
