"""One server and one browser for all tests of pages, and an application that answers without them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from studio.browser import RunningStudio, running_studio
from studio.served import Client, studio


@pytest.fixture(scope="module", name="client")
def client_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Client]:
    """A studio whose tasks run in this process, and who asks it."""
    with studio(tmp_path_factory.mktemp("data")) as served:
        yield served


@pytest.fixture(scope="session", name="studio")
def studio_fixture(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningStudio]:
    """A studio that runs as the real command."""
    with running_studio(tmp_path_factory.mktemp("studio")) as own:
        yield own


@pytest.fixture(scope="module", name="context")
def context_fixture(browser: Any, studio: RunningStudio) -> Iterator[Any]:
    """What the pages of a module share: files that were fetched."""
    own = browser.new_context(
        base_url=studio.address, viewport={"width": 1280, "height": 900}, reduced_motion="reduce"
    )
    own.set_default_timeout(120_000)
    yield own
    own.close()


@pytest.fixture(name="page")
def page_fixture(context: Any, studio: RunningStudio) -> Iterator[Any]:
    """A page of the studio that tells of every error, and asks no other host for anything."""
    page, wrong = context.new_page(), list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("response", lambda got: got.status in (200, 206, 304, 422) or wrong.append(got.url))
    page.on(
        "console",
        lambda said: said.type != "error" or "422" in said.text or wrong.append(said.text),
    )
    page.on(
        "request",
        lambda asked: (
            asked.url.startswith((studio.address, "blob:", "data:")) or wrong.append(asked.url)
        ),
    )
    page.wrong = wrong
    yield page
    if not page.is_closed() and page.url.startswith(studio.address):
        page.evaluate("localStorage.clear()")
    context.clear_permissions()
    for own in context.pages:
        own.close()
    assert wrong == []


@pytest.fixture(scope="session", name="searched")
def searched_fixture(studio: RunningStudio) -> str:
    """A project with the tile of one class that a search has found."""
    return studio.with_tiles()


@pytest.fixture(name="drawing")
def drawing_fixture(tmp_path: Path) -> Path:
    """A picture: a dark shape with a leg, and a speck beside it, on white."""
    from PIL import Image, ImageDraw

    picture = Image.new("L", (240, 200), 255)
    draw = ImageDraw.Draw(picture)
    draw.polygon(
        [(30, 40), (170, 30), (180, 110), (120, 120), (120, 180), (80, 180), (80, 120), (30, 110)],
        fill=40,
    )
    draw.ellipse([205, 20, 230, 45], fill=40)
    picture.save(tmp_path / "beast.png")
    return tmp_path / "beast.png"
