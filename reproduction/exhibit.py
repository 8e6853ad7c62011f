"""What an exhibit is: what the paper shows, the work that it needs, and how it is drawn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

from reproduction.drawing import Canvas, Picture


class Extent(NamedTuple):
    """How much work a reproduction is: all of it, by default, or a preview.

    - `frequencies`: The values of Omega in the ablation, with the paper's 5.
    - `affine`, `iterations`: The steps of both phases of the paper's method.
    - `effort`: The effort of our own searches.
    - `classes`: The classes that our own searches try for each goal, None for all nine.
    - `points`: The number of points drawn from each target density.
    - `evaluations`: The number of evaluations of each density's likelihood and gradient.
    - `grid`: The number of points along a side at which KL divergences are taken.
    - `resolution`: The number of cells along a side of surfaces in space.
    """

    name: str = "full"
    frequencies: tuple[int, ...] = (0, 1, 2, 3, 5, 10)
    affine: int = 80
    iterations: int = 200
    effort: str = "normal"
    classes: tuple[str, ...] | None = None
    points: int = 65_536
    evaluations: int = 150
    grid: int = 200
    resolution: int = 160


# everything, in about ten minutes on two cores
FULL = Extent()
# A preview of two minutes: every exhibit, with less work in each
FAST = Extent(
    name="fast", frequencies=(0, 2, 5), affine=30, iterations=30, effort="fast", classes=("IH6",),
    points=16_384, evaluations=24, grid=100, resolution=100,
)  # fmt: skip


class Work(NamedTuple):
    """A call that takes long: `function(*arguments)`, a module's function with plain arguments.

    Exhibits that need equal work share it. Its value is passed between processes.

    - `cost`: About how many seconds it takes; the longest calls begin first.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    cost: float = 1.0


class Table(NamedTuple):
    """A table of texts; `caption` says what they are."""

    caption: str
    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class Findings:
    """What we see and measure, whether the paper agrees, why not, and the numbers for `paper.json`."""

    verdict: Literal["agrees", "agrees in part", "differs"]
    found: str
    why: str = ""
    numbers: Mapping[str, Any] = field(default_factory=dict)
    tables: Sequence[Table] = ()


# A function that draws into a canvas, given the values of the exhibit's work, in its order
Draw = Callable[[Canvas, Extent, list[Any]], Findings]


@dataclass(frozen=True)
class Exhibit:
    """A figure or table of the paper: what the paper `states`, and how it is drawn here.

    - `name`: The name with which its files begin, such as "figure-1".
    - `needs`: A function that returns the work to be done first.
    """

    name: str
    title: str
    states: str
    draw: Draw
    needs: Callable[[Extent], list[Work]] = lambda _extent: []

    @property
    def label(self) -> str:
        """The paper's label, such as "Figure 1"."""
        return self.name.replace("-", " ").title()


class Shown(NamedTuple):
    """An exhibit as it was drawn: its pictures and findings, or the `failure`."""

    exhibit: Exhibit
    pictures: tuple[Picture, ...] = ()
    findings: Findings | None = None
    failure: str = ""
