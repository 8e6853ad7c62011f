"""What a tile is measured by, what cannot be made of it, and the best tile of which that can."""

from __future__ import annotations

from typing import Any

from orbiflow.errors import OrbiflowError
from orbiflow.studio.routes import Routes, Studio
from orbiflow.studio.tile_files import tile_folder

WORLDS = {
    "sphere": {"art": ("world", ["sphere"]), "solid": ("kind", ["ball", "ball-piece", "lamp"])},
    "disc": {"art": ("world", ["disc", "half-plane", "band"])},
}
"""Choices that need a tile which goes to another world, by world and operation."""

routes = Routes()


@routes("GET", "/projects/{project}/tiles/{tile}/cannot")
def cannot(project: str, tile: int, here: Studio) -> dict[str, list[dict[str, Any]]]:
    """Return, by operation, choices that a tile does not have: `setting`, `values`, `why`, `instead`.

    `instead` is the number of another tile that has them, or None.
    """
    here.store.card(project, tile)
    home, cards = here.store.home(project), here.store.cards(project)
    others = sorted(cards, key=lambda card: (-card["stars"], -card["score"]))

    def why_not(number: int, world: str, makes: str) -> str:
        from orbiflow.tiles import read_result, why_not_in

        try:
            candidate = read_result(tile_folder(home, number))
        except OrbiflowError as error:  # it has just been removed
            return str(error)
        if len(candidate.figures) > 1 and makes == "solid":
            return "a ball is made of a tile of one figure"
        return why_not_in(candidate, world)

    refused: dict[str, list[dict[str, Any]]] = {}
    for world, choices in WORLDS.items():
        for makes, (setting, values) in choices.items():
            if why := why_not(tile, world, makes):
                able = (card["id"] for card in others if not why_not(card["id"], world, makes))
                refused.setdefault(makes, []).append(
                    {"setting": setting, "values": values, "why": why, "instead": next(able, None)}
                )
    return refused


@routes("GET", "/projects/{project}/tiles/{tile}/rectangles")
def rectangles(project: str, tile: int, here: Studio) -> list[list[list[float]]]:
    """Return the corners of the smallest rectangle around each figure, by which files measure it."""
    from orbiflow.tiles import read_result, smallest_rectangle

    here.store.card(project, tile)
    figures = read_result(tile_folder(here.store.home(project), tile)).figures
    return [smallest_rectangle(part.prototile.polygon).tolist() for part in figures]
