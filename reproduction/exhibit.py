"""What an exhibit is: what the paper shows, the work that it needs, and how ours is drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from reproduction.canvas import Canvas, Picture
from reproduction.extent import Extent

Verdict = Literal["agrees", "agrees in part", "differs"]
"""Of what the paper states with what we find."""


class Work(NamedTuple):
    """A call that takes long: `function(*arguments)`, of a module and with plain arguments.

    Exhibits that need equal work share it. Its value goes from process to process.

    - `cost`: seconds or so; the longest begin first.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    cost: float = 1.0

    @property
    def key(self) -> tuple[str, tuple[Any, ...]]:
        """Equal for equal work."""
        return f"{self.function.__module__}.{self.function.__qualname__}", self.arguments


class Table(NamedTuple):
    """Rows of texts under headings; `caption` says what they are."""

    caption: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Findings:
    """What drawing an exhibit found.

    - `verdict`: whether it is as the paper states.
    - `found`: what we see and measure, in words.
    - `why`: why it differs, "" if it does not.
    - `numbers`: for `paper.json`, by name.
    - `tables`: shown below the pictures.
    """

    verdict: Verdict
    found: str
    why: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    tables: Sequence[Table] = ()


Draw = Callable[[Canvas, Extent, list[Any]], Findings]
"""Draws into a canvas, given the values of the work that the exhibit needs, in its order."""


def no_work(_extent: Extent) -> list[Work]:
    """For exhibits that are drawn at once."""
    return []


@dataclass(frozen=True)
class Exhibit:
    """A figure or table of the paper.

    - `name`: of its files, such as "figure-1".
    - `label`: as the paper has it, such as "Figure 1".
    - `title`: what it is about.
    - `states`: what the paper shows or claims.
    - `draw`: ours.
    - `needs`: the work to be done first.
    """

    name: str
    label: str
    title: str
    states: str
    draw: Draw
    needs: Callable[[Extent], list[Work]] = no_work


@dataclass(frozen=True)
class Shown:
    """An exhibit with what came of it: `findings`, or why there are none.

    - `seconds`: that its drawing took, without the work that it needed.
    """

    exhibit: Exhibit
    pictures: tuple[Picture, ...] = ()
    findings: Findings | None = None
    failure: str = ""
    seconds: float = 0.0
