"""One server and one browser for all tests of pages, and an application that answers without them."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from orbiflow import drawing
from orbiflow.studio import silhouette_file, taking
from studio.browser import RunningStudio, running_studio
from studio.served import Client, studio

VIEWPORT = {"width": 1280, "height": 900}


@pytest.fixture(scope="module", autouse=True)
def small_pictures() -> Iterator[None]:
    """Draw backdrops and previews with fewer pixels in this process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(silhouette_file, "BACKDROP_SIDE_PIXELS", 400)
        patch.setattr(taking, "PREVIEW_SIDE_PIXELS", 300)
        full = drawing.solid_picture
        patch.setattr(drawing, "solid_picture", lambda parts, *_: full(parts, (240, 180)))
        yield


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
    own = browser.new_context(base_url=studio.address, viewport=VIEWPORT, reduced_motion="reduce")
    own.set_default_timeout(120_000)
    yield own
    own.close()


class Tab:
    """A page of the studio that tells of every error, and asks no other host for anything."""

    def __init__(self, context: Any, address: str) -> None:
        self.context, self.address = context, address
        self.wrong = list[str]()
        self.page: Any = None

    def ready(self) -> Any:
        """Return a page that shows nothing of an earlier test."""
        if self.page is None or self.page.is_closed():
            self.page = self.context.new_page()
            self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
            self.page.on("response", self.hear_response)
            self.page.on("console", self.hear_console)
            self.page.on("request", self.hear_request)
            self.page.wrong = self.wrong
        return self.page

    def hear_response(self, response: Any) -> None:
        if response.status not in (200, 206, 304, 422):
            self.wrong.append(response.url)

    def hear_console(self, message: Any) -> None:
        if message.type == "error" and "422" not in message.text:
            self.wrong.append(message.text)

    def hear_request(self, request: Any) -> None:
        if not request.url.startswith((self.address, "blob:", "data:")):
            self.wrong.append(request.url)

    def close(self) -> None:
        """Close the page and what a test opened beside it."""
        if not self.page.is_closed() and self.page.url.startswith(self.address):
            self.page.evaluate("localStorage.clear()")
        self.context.clear_permissions()
        for page in self.context.pages:
            page.close()

    def leave(self) -> None:
        """Take back what a test has changed, for the next one to go on with the same page."""
        page, self.page = self.page, None  # if anything fails here, the next test has another one
        for other in self.context.pages:
            if other is not page:
                other.close()
        self.context.clear_permissions()
        if page.is_closed():
            return
        if not page.url.startswith(self.address):
            page.close()
            return
        page.unroute_all()
        page.emulate_media(color_scheme="light", reduced_motion="reduce")
        page.set_viewport_size(VIEWPORT)
        page.evaluate(
            """() => {
                document.querySelectorAll("dialog[open]").forEach((dialog) => dialog.close());
                localStorage.clear();
                location.hash = "#/none";
            }"""
        )
        page.get_by_role("heading", name="This page cannot be shown").wait_for()
        self.page = page


@pytest.fixture(scope="module", name="tab")
def tab_fixture(context: Any, studio: RunningStudio) -> Tab:
    return Tab(context, studio.address)


@pytest.fixture(name="page")
def page_fixture(tab: Tab, request: pytest.FixtureRequest) -> Iterator[Any]:
    """A page of the studio on which nothing may go wrong.

    It is a new one for each test, but in modules that have `ONE_PAGE`: there it goes from one test to
    the next with the scripts that it has loaded, which takes a second.
    """
    tab.wrong.clear()
    yield tab.ready()
    tab.leave() if getattr(request.module, "ONE_PAGE", False) else tab.close()
    assert tab.wrong == []


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
