"""Drawings are rendered small and in this process, which starts none for each of them."""

from collections.abc import Iterator
from typing import Any

import pytest
import resvg_py

from orbiflow.tiles.silhouette.readers import svg
from orbiflow.tiles.silhouette.readers.svg_process import Renderer, RendererFailed


def render(_: Renderer, text: str, options: dict[str, Any]) -> bytes:
    try:
        return bytes(resvg_py.svg_to_bytes(svg_string=text, **options))
    except ValueError as error:
        raise RendererFailed(str(error)[:200]) from None


@pytest.fixture(name="_rendered_here", scope="module", autouse=True)
def rendered_here_fixture() -> Iterator[None]:
    """To start a process takes as long as all else of a test; `test_svg_bounds` tests the process."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Renderer, "png", render)
        yield


@pytest.fixture(name="_small_pictures", scope="module", autouse=True)
def small_pictures_fixture() -> Iterator[None]:
    """What is seen of a drawing does not depend on how finely it is traced."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(svg, "LONG_PIXELS", 400)
        patch.setattr(svg, "SMALL_PIXELS", 150)
        yield
