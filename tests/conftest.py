"""Settings for all tests: one torch thread and seed, hypothesis without deadlines."""

import gc
import os
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest
import torch
from _pytest.doctest import DoctestModule
from hypothesis import HealthCheck, register_random, settings
from hypothesis.internal.conjecture import providers

from bent_tiles import bent_tile_fixture, equivariant_fixture  # noqa: F401
from small_searches import small_searches_fixture  # noqa: F401
from studio.browser import chromium

# Docker images often forbid compiled files: then each process of a test compiles the package anew
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

torch.set_num_threads(1)
torch.set_warn_always(True)  # a warning must not depend on which test comes first

settings.register_profile(
    "explore", deadline=None, max_examples=30, suppress_health_check=[HealthCheck.too_slow]
)
settings.register_profile(
    "same", settings.get_profile("explore"), derandomize=True, database=None, max_examples=8
)
settings.load_profile("explore" if os.environ.get("ORBIFLOW_EXPLORE") else "same")
# or else inputs hold numbers from the source of whichever modules a worker has imported
pytest.MonkeyPatch().setattr(providers, "is_local_module_file", lambda _: False)


# what it does when it is imported is for processes alone, and the search for doctests imports all
collect_ignore = ["runtime/small_process.py", "runtime/endless_process.py"]

gc.disable()  # until all is collected: modules and tests are no litter


def pytest_collection_finish() -> None:
    """Look for litter less often, and not among modules: it took up to a tenth of the time."""
    gc.freeze()
    gc.enable()
    gc.set_threshold(10_000, 20, 20)


class TorchRandom:
    """Torch's own generator, for hypothesis to seed before every example."""

    seed = staticmethod(torch.default_generator.manual_seed)
    getstate = staticmethod(torch.get_rng_state)
    setstate = staticmethod(torch.set_rng_state)


torch_random = TorchRandom()  # hypothesis keeps a weak reference
register_random(torch_random)


@pytest.hookimpl(wrapper=True)
def pytest_collect_file() -> Iterator[Any]:
    """Look for examples in the docstrings of the package alone: tests have none."""
    found = yield
    return [own for own in found if not isinstance(own, DoctestModule)]


def pytest_runtest_setup() -> None:
    """A test that draws without a seed draws the same whichever tests went before."""
    torch.default_generator.manual_seed(0)


@pytest.fixture(scope="module", autouse=True)
def no_thread_stays() -> Iterator[None]:
    """Check that a module leaves no thread: workers of later tests could not be forked beside it."""
    before = {*threading.enumerate()}
    yield
    started = {*threading.enumerate()} - before
    for thread in started:
        thread.join(timeout=20)
    assert [thread.name for thread in started if thread.is_alive()] == []


@pytest.fixture(scope="module", name="browser")
def browser_fixture() -> Iterator[Any]:
    """A browser without windows; while it is there, no other loop of events can run."""
    program = chromium()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        own = playwright.chromium.launch(
            executable_path=program,
            args=[
                *("--no-sandbox", "--disable-gpu"),
                *("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"),
            ],
        )
        yield own
        own.close()
