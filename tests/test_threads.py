"""One torch thread in a block: restored, nested, and entered by many threads at once."""

import random
import threading
from collections.abc import Callable, Iterator

import pytest
import torch

from orbiflow.runtime import one_thread

THREADS = 3


@pytest.fixture(autouse=True)
def several_threads() -> Iterator[None]:
    before = torch.get_num_threads()
    torch.set_num_threads(THREADS)
    yield
    torch.set_num_threads(before)


def in_new_threads(function: Callable[[], object], count: int = 1) -> list[object]:
    """What `function` gives, or raises, in each of `count` threads at once."""
    found: list[object] = []

    def work() -> None:
        try:
            found.append(function())
        except BaseException as error:
            found.append(error)

    threads = [threading.Thread(target=work) for _ in range(count)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def test_one_inside_and_the_callers_number_after():
    with one_thread():
        assert torch.get_num_threads() == 1
        with one_thread():
            assert torch.get_num_threads() == 1
        assert torch.get_num_threads() == 1
    assert torch.get_num_threads() == THREADS


def test_restored_after_an_exception():
    with pytest.raises(KeyboardInterrupt), one_thread():
        raise KeyboardInterrupt
    assert torch.get_num_threads() == THREADS


def test_a_thread_started_meanwhile_is_not_limited():
    with one_thread():
        assert in_new_threads(torch.get_num_threads) == [THREADS]
    assert in_new_threads(torch.get_num_threads) == [THREADS]


def test_blocks_that_overlap_in_two_threads():
    inside, leave = threading.Event(), threading.Event()
    after: list[int] = []

    def first() -> None:
        with one_thread():
            inside.set()
            leave.wait(60)
        after.append(torch.get_num_threads())

    thread = threading.Thread(target=first)
    thread.start()
    inside.wait(60)
    # enters while the other is inside, leaves after it
    with one_thread():
        leave.set()
        thread.join()
        assert torch.get_num_threads() == 1
    assert [torch.get_num_threads(), *after] == [THREADS, THREADS]
    assert in_new_threads(torch.get_num_threads) == [THREADS]


def test_many_threads_at_once_leave_nothing_behind():
    def work() -> int:
        chance = random.Random(threading.get_ident())
        for _ in range(30):
            with one_thread():
                assert torch.get_num_threads() == 1
                if chance.random() < 0.5:
                    with one_thread():
                        torch.ones(8).sum()
                assert torch.get_num_threads() == 1
            assert torch.get_num_threads() == THREADS
        return torch.get_num_threads()

    assert in_new_threads(work, 12) == [THREADS] * 12
    assert torch.get_num_threads() == THREADS
    assert in_new_threads(torch.get_num_threads) == [THREADS]
