"""The search for tiles of one silhouette: class after class, one level of effort after another."""

from __future__ import annotations

import contextlib
import functools
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from orbiflow.errors import CertificationError, OrbiflowError
from orbiflow.runtime import Cancel, one_blas_thread, one_thread, process_context, work
from orbiflow.settings import as_instance, described, is_a
from orbiflow.tiles.search.candidates import OnProgress
from orbiflow.tiles.search.finished_tiles import ClassFailure, best_tiles
from orbiflow.tiles.search.search_method import Goal, SearchMethod, Sketches
from orbiflow.tiles.search.search_record import Found, Outcome, Record, without_twins
from orbiflow.tiles.silhouette import HOW_TO_GET_A_TARGET, Pins, Target
from orbiflow.tiles.tile import EscherTile
from orbiflow.tiles.tilings import IsohedralClass, isohedral_class

PROMISING_SHARE = 0.5  # of classes that go on to the next level, before that is known
SKETCHING = 0.1  # the share of the work that first looks are, if somebody watches


@dataclass(frozen=True, eq=False)
class ClassTask:
    """What is to be done for each class, checked."""

    goal: Goal
    method: SearchMethod
    per_class: int = 1
    force: bool = False

    def __post_init__(self) -> None:
        as_instance(self.goal.target, Target, "the target", HOW_TO_GET_A_TARGET)
        if not is_a(self.method, SearchMethod):
            raise OrbiflowError(
                f"the method must be a search such as LikenessSearch(), got {described(self.method)}; "
                'for a level of effort: LikenessSearch.for_effort("fast")'
            )
        if self.goal.pins is not None:
            as_instance(self.goal.pins, Pins, "pins", "Pins.read and Pins.at make one")
            if not self.method.takes_pins:
                raise OrbiflowError(
                    "pins belong to the search for likeness, where silhouettes bend"
                )

    def outcome(self, kind: IsohedralClass, progress: OnProgress, cancel: Cancel) -> Outcome:
        """Return the best certified tile of a class, which holds the others, or why there is none."""
        begin = time.perf_counter()
        try:
            # many small systems: several threads would wait for each other, ten times as long as
            # they work
            with one_thread(), one_blas_thread():
                chosen = self._chosen_tiles(kind, progress, cancel)
        except CertificationError as error:
            return ClassFailure(kind.name, str(error))
        facts = [replace(tile.search, seconds=time.perf_counter() - begin) for tile in chosen]
        best, *others = (
            tile.changed(search=fact) for tile, fact in zip(chosen, facts, strict=True)
        )
        return best.changed(others=tuple(others))

    def _chosen_tiles(
        self, kind: IsohedralClass, progress: OnProgress, cancel: Cancel
    ) -> list[EscherTile]:
        """Return the tiles of a class that are shown, best first, no two of them alike.

        They are those of the first goal that has some.

        Raises:
            CertificationError: If none has, with the first one's reason.
        """
        reasons: list[CertificationError] = []
        for share, goal in self.method.goals(self.goal):
            try:
                tiles = best_tiles(
                    goal.target,
                    self.method.fit(goal, kind, self.per_class, progress, cancel),
                    force=self.force,
                    min_neck=self.method.least_neck(goal),
                    original=self.goal.target,
                    smoothed=share,
                )
                cancel.check()
                return [tiles[k] for k in without_twins(tiles, self.per_class)]
            except CertificationError as error:
                reasons.append(error)
        raise reasons[0]


def _work_on(
    task: ClassTask, name: str, tell: Callable[[tuple[float, float]], None], cancel: Cancel
) -> Outcome:
    """Do the task for a class in a worker process."""
    return task.outcome(isohedral_class(name), lambda share, loss: tell((share, loss)), cancel)


class ClassSearch:
    """Does a task for each class, and keeps and reports what it finds."""

    def __init__(self, task: ClassTask, workers: int, notes: Sequence[str], record: Record) -> None:
        self.task, self.notes, self.record = task, notes, record
        self.method = task.method
        self.names = list(record.shares)
        self.workers = min(workers, len(self.names))

    def look_first(self, cancel: Cancel) -> None:
        """Show a certified tile of one of the classes in a moment, if the method can."""
        end = SKETCHING * (self.record.on_tile is not None)
        self.record.next_level("sketch", 0.0, end, self.names)
        with one_thread(), one_blas_thread():
            first = self.method.preview(self.task.goal, self.names, cancel)
        if first is not None:
            self.record.first_look(first)

    def search(self, cancel: Cancel) -> None:
        """Do the task, one level of effort after another, each for the promising classes."""
        method, names, record, begin = self.method, self.names, self.record, 0.0
        # asked before torch is limited here: a limit makes no fork safe
        preload = (__name__, type(method).__module__)
        context = process_context(preload) if self.workers > 1 else None
        if record.on_tile is not None:
            begin = SKETCHING
            sketches = replace(self.task, method=Sketches(method), per_class=1)
            self._do(
                sketches, [name for name in names if name not in record.looks], context, cancel
            )
        levels, done = method.levels(), 0.0
        for number, (effort, level) in enumerate(levels):
            is_last = number == len(levels) - 1
            now = effort * len(names)
            later = PROMISING_SHARE * len(names) * sum(other for other, _ in levels[number + 1 :])
            left = (1 - begin) / (done + now + later)  # of the whole, for a unit of work
            end = 1.0 if is_last else begin + (done + now) * left
            record.next_level("final" if is_last else "better", begin + done * left, end, names)
            done += now
            self._do(replace(self.task, method=level), names, context, cancel)
            if not is_last:
                names = record.settled(names, method.is_promising)

    def finish(self) -> Found:
        """Return what was found."""
        return self.record.finish()

    def _do(self, task: ClassTask, names: Sequence[str], context: Any, cancel: Cancel) -> None:
        if context is not None and len(names) > 1:
            self._do_in_processes(task, names, context, cancel)
            return
        for name in names:
            cancel.check()
            progress = functools.partial(self.record.progress, name)
            self.record.level_outcome(task.outcome(isohedral_class(name), progress, cancel))

    def _do_in_processes(
        self, task: ClassTask, names: Sequence[str], context: Any, cancel: Cancel
    ) -> None:
        cancel.check()
        if context.get_start_method() == "fork":
            with one_thread(), one_blas_thread():
                task.method.prepare(task.goal)  # once, for all workers
        order = task.method.in_order(names)
        items = work(
            functools.partial(_work_on, task), order, self.workers, context=context, cancel=cancel
        )
        with contextlib.closing(items) as news:
            for item in news:
                if item.done:
                    self.record.level_outcome(item.value)
                else:
                    self.record.progress(order[item.index], *item.value)
