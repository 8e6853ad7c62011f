"""Worker processes: news, errors, deaths and cancelling."""

import multiprocessing
import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from orbiflow.density import UndeclaredError
from orbiflow.errors import OrbiflowError
from orbiflow.runtime import Cancel, work
from refusals import refused

Tell = Callable[[Any], None]


def square(item: int, tell: Tell, _cancel: Cancel) -> int:
    tell(f"squaring {item}")
    return item * item


def forever(_item: int, tell: Tell, cancel: Cancel) -> int:
    tell("begun")
    while True:
        cancel.check()


def mistaken(item: int, _tell: Tell, _cancel: Cancel) -> int:
    raise OrbiflowError(f"no such thing as {item}")


class Odd(Exception):
    """Cannot be unpickled from its message."""

    def __init__(self, one: int, two: int) -> None:
        super().__init__(f"{one} and {two}")


def undeclared(_item: int, _tell: Tell, _cancel: Cancel) -> int:
    raise UndeclaredError("{columns} of it", ["v"], "v=linear")


def odd(_item: int, _tell: Tell, _cancel: Cancel) -> int:
    raise Odd(1, 2)


def dying(_item: int, _tell: Tell, _cancel: Cancel) -> int:
    os._exit(3)


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_item_is_done_once_and_its_news_come_first(workers: int) -> None:
    news = list(work(square, range(4), workers))
    for index in range(4):
        own = [(n.value, n.done) for n in news if n.index == index]
        assert own == [(f"squaring {index}", False), (index * index, True)]
    assert multiprocessing.active_children() == []


def test_no_items() -> None:
    assert list(work(square, [], 2)) == []


def test_an_error_comes_out_with_its_traceback() -> None:
    with refused(7) as caught:
        list(work(mistaken, [7], 2))
    assert "in mistaken" in "".join(caught.value.__notes__)
    with refused("columns of it", kind=UndeclaredError) as caught:
        list(work(undeclared, [7], 2))
    assert (caught.value.columns, caught.value.proposal) == (("v",), "v=linear")
    with refused("Odd", 1, 2, kind=RuntimeError):
        list(work(odd, [7], 1))


def test_a_worker_that_dies_is_an_error() -> None:
    with refused():
        list(work(dying, range(3), 2))
    assert multiprocessing.active_children() == []


def dying_once(item: tuple[int, Path], _tell: Tell, _cancel: Cancel) -> int:
    number, mark = item
    if number == 1 and not mark.exists():
        mark.touch()
        os._exit(3)
    return number


def dying_of_two(item: int, _tell: Tell, _cancel: Cancel) -> int:
    if item == 2:
        os._exit(3)
    return item


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_a_worker_that_dies_is_replaced_and_its_item_tried_again(workers: int, tmp_path) -> None:
    items = [(number, tmp_path / "mark") for number in range(4)]
    news = list(work(dying_once, items, workers, tries=2))
    assert sorted(n.value for n in news) == [0, 1, 2, 3]
    assert all(n.done and not n.died for n in news)
    assert multiprocessing.active_children() == []


@pytest.mark.parametrize("workers", [1, 3])
def test_an_item_that_kills_every_worker_fails_alone(workers: int) -> None:
    news = list(work(dying_of_two, iter(range(5)), workers, tries=3))
    assert sorted(n.value for n in news if not n.died) == [0, 1, 3, 4]
    assert [(n.index, n.done) for n in news if n.died] == [(2, True)]
    assert multiprocessing.active_children() == []


def test_items_are_taken_when_they_are_needed() -> None:
    taken = []

    def items() -> Iterator[int]:
        for number in range(9):
            taken.append(number)
            yield number

    news = work(square, items(), 2)
    next(news)
    news.close()
    assert len(taken) <= 3


def test_cancelling_ends_all() -> None:
    cancel = Cancel()
    told = []
    for news in work(forever, range(9), 2, cancel=cancel):
        told.append(news)
        cancel.cancel()
    assert 1 <= len(told) <= 2
    assert not any(news.done for news in told)
    assert multiprocessing.active_children() == []


def test_closing_ends_all() -> None:
    news = work(forever, range(9), 2)
    assert next(news).value == "begun"
    news.close()
    assert multiprocessing.active_children() == []
