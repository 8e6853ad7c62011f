"""A world as a page of its own: opened from a file, turned by hand and by keys, without a network."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from orbiflow.tiles import ArtSettings, EscherTile, art
from refusals import refused
from swirled_tiles import swirled_tile


def seen(page: Any) -> np.ndarray:
    page.wait_for_function("document.querySelector('#view').dataset.drawn")
    page.evaluate("new Promise((r) => requestAnimationFrame(() => requestAnimationFrame(r)))")
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")).astype(int)


@pytest.mark.parametrize(
    ("world", "order"), [("sphere", (2, 3, 4)), ("disc", (3, 3, 4)), ("disc", (2, 3, 7))]
)
def test_a_world_is_turned(browser: Any, tmp_path: Path, world: Any, order: Any) -> None:
    tile = EscherTile(swirled_tile("IH28", 3, 0.1))
    chosen = ArtSettings(format="html", world=world, order=order, engrave=True, palette="lagoon")
    art(tile, tmp_path / "world.html", chosen)
    page, wrong = browser.new_page(viewport={"width": 500, "height": 400}), list[str]()
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "request", lambda asked: asked.url.startswith(("file:", "data:")) or wrong.append(asked.url)
    )
    page.goto(f"file://{tmp_path / 'world.html'}")
    first = seen(page)
    assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    page.mouse.move(250, 200)
    page.mouse.down()
    page.mouse.move(330, 160, steps=4)
    page.mouse.up()
    second = seen(page)
    assert (np.abs(second - first).max(axis=-1) > 30).mean() > 0.1
    page.locator("#view").focus()
    for _ in range(30):
        page.keyboard.press("ArrowLeft")
    page.keyboard.press("+")
    third = seen(page)
    assert (np.abs(third - second).max(axis=-1) > 30).mean() > 0.1
    page.get_by_role("button", name="Fit").click()
    again = seen(page)
    assert (np.abs(again[:350] - first[:350]).max(axis=-1) > 30).mean() < 0.05
    page.close()
    assert wrong == []


def test_only_spheres_and_discs_are_pages(tmp_path: Path) -> None:
    with refused("world"):
        art(EscherTile(swirled_tile("IH28", 3, 0.1)), tmp_path / "a.html")
