"""The overview and the page of a run: complete, self-contained, and proof against odd names."""

import io
import re
import shlex
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely
from PIL import Image

from orbiflow.runtime import Call
from orbiflow.tiles import (
    ClassFailure,
    EscherTile,
    LikenessSearch,
    OccupancySearch,
    Rating,
    SearchResult,
    Target,
    escherize_class,
    folder_names,
    index_page,
    overview_png,
    write_gallery,
    written_files,
)
from orbiflow.tiles.run_folder.html_page import TRIED
from shell_lines import call_by_orbiflow
from small_searches import FEW

BOOT = [(60, 20), (210, 20), (230, 80), (170, 95), (160, 190), (100, 145), (45, 80)]
VOID = {"meta", "link", "img", "br", "path", "hr", "input"}
ODD = 'a "boot" <script>&.png'


class Page(HTMLParser):
    """What a page holds; every tag must be closed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words = ""
        self.commands: list[str] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
        if tag == "code":
            self.commands.append("")

    def handle_endtag(self, tag: str) -> None:
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] not in ("style", "script"):
            self.words += data
        if "code" in self.open:
            self.commands[-1] += data

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


@pytest.fixture(scope="module", name="target")
def target_fixture() -> Target:
    return Target.from_polygon(BOOT, y_down=True, source=f"some/{ODD}")


@pytest.fixture(scope="module", name="bent")
def bent_fixture(target: Target) -> EscherTile:
    small = LikenessSearch(**FEW)
    found = escherize_class(target, "IH4", small)
    assert isinstance(found, EscherTile)
    return found


@pytest.fixture(scope="module", name="flowed")
def flowed_fixture(target: Target) -> EscherTile:
    few = OccupancySearch(iterations=4, turns=1, max_frequency=2)
    found = escherize_class(target, "IH6", few)
    assert isinstance(found, EscherTile)
    return found


def test_a_page_names_everything_and_refers_to_what_is_there(
    target: Target, bent: EscherTile, flowed: EscherTile, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setattr("orbiflow.drawing.canvas._SAMPLES", 40)
    monkeypatch.setattr("orbiflow.drawing.canvas._STEPS", 4)
    failed = [ClassFailure("IH21", "it <crosses> itself")]
    write_gallery(SearchResult(target, [bent, flowed, bent], failed), tmp_path, figures=True)
    (tmp_path / "result.json").write_text("{}")
    page = Page((tmp_path / "index.html").read_text("utf-8"))
    assert ODD in page.words
    assert "IH21: it <crosses> itself" in page.words
    assert {"html", "title", "main", "header", "fieldset", "style"} <= {tag for tag, _ in page.tags}
    assert page.all("html")[0]["lang"] == "en"
    assert page.all("script") == [{}]
    assert page.all("link") == []
    assert not [name for _, attributes in page.tags for name in attributes if name[:2] == "on"]
    pictures = page.all("img")
    to_choose = [picture for picture in pictures if not picture["alt"]]
    assert len(to_choose) == len(page.all("label")) == 3  # each in a label with words
    assert len(pictures) == 3 + 3 * 3 + 1  # one has a flow
    ids = {attributes.get("id") for _, attributes in page.tags}
    assert [a["id"] for a in page.all("article")[:3]] == ["IH4", "IH6", "IH4-2"]
    for reference in [a["href"] for a in page.all("a")] + [p["src"] for p in pictures]:
        assert reference
        if reference.startswith("#"):
            assert reference[1:] in ids
        else:
            assert (tmp_path / reference).is_file()
    written = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    assert sum("field.png" in name for name in written) == 1
    assert {"IH4-2/tile.svg", "overview.png", "index.html"} <= written


def test_commands_of_a_page_can_be_copied_into_a_shell(target, bent, flowed) -> None:
    out, names = "-my <b> $(out)/it's", ["IH4", "IH6", "IH4-2"]
    refused = flowed.changed(tile=replace(flowed.tile, polygon=flowed.tile.polygon * (1.0, 1.1)))
    page = Page(index_page([bent, refused, bent], [target], names, out=out))
    calls = [call_by_orbiflow(shlex.split(command)[1:]) for command in page.commands]
    assert len(calls) == 10 + 3 * len(TRIED)
    assert all(isinstance(call, Call) for call in calls)
    flat = [call.flat for call in calls if isinstance(call, Call)]
    palettes = flat[: 3 * len(TRIED) : len(TRIED)]
    assert [call["result"] for call in palettes] == [Path(out) / n for n in names]
    assert [call["force"] for call in palettes] == [False, True, False]
    assert {call["result"] for call in flat[3 * len(TRIED) :]} == {Path(out) / "IH4"}
    files = [call["out"] for call in flat]
    assert len(set(files)) == len(files)
    assert {call["palette"] for call in flat if call.get("palette")} >= set(TRIED)


def test_small_tilings_are_those_of_the_tile(target: Target, bent: EscherTile) -> None:
    page = Page(index_page([bent], [target], ["IH4"]))
    uses = page.all("use")
    ids = {attributes.get("id") for _, attributes in page.tags}
    assert {str(use["href"])[1:] for use in uses} <= ids
    assert sum(use["href"] == "#IH4-patch" for use in uses) == len(TRIED)
    matrices = [str(use["transform"])[7:-1].split() for use in uses if "transform" in use]
    assert len(matrices) > 6
    ring = np.array(re.findall(r"[-\d.]+,[-\d.]+", str(page.all("path")[1]["d"])))
    corners = np.array([[float(x) for x in pair.split(",")] for pair in ring])
    copies = [shapely.Polygon(corners @ np.reshape(m[:4], (2, 2)) + m[4:])
              for m in np.array(matrices, dtype=float)]  # fmt: skip
    left, low, width, height = (float(x) for x in str(page.all("svg")[1]["viewbox"]).split())
    window = shapely.box(left, low, left + width, low + height)
    pieces = [copy.intersection(window) for copy in copies]
    assert sum(piece.area for piece in pieces) == pytest.approx(window.area, rel=0.01)
    assert shapely.union_all(pieces).area > 0.99 * window.area


def test_what_is_not_certified_says_so(target: Target, flowed: EscherTile) -> None:
    bad = replace(flowed.certificate, reasons=("it <overlaps> itself",))
    uncertified = replace(flowed)
    vars(uncertified)["certificate"] = bad  # no real reason has characters to escape
    page = Page(index_page([uncertified], [target], ["IH6"]))
    assert "Not certified: it <overlaps> itself." in page.words


@pytest.mark.parametrize("wide", [1.0, 90.0, 1 / 90])
def test_an_overview_of_a_long_silhouette(flowed: EscherTile, wide: float) -> None:
    ring = np.array(BOOT) * (wide**0.5, wide**-0.5)
    picture = overview_png([flowed], [Target.from_polygon(ring)])
    assert Image.open(io.BytesIO(picture)).width == 1320


def test_the_page_is_one_of_the_files_of_a_run(tmp_path: Path) -> None:
    (tmp_path / "result.json").write_text('{"schema_version": 2, "tiles": [{"class": "IH4"}]}')
    known = written_files(tmp_path)
    assert {"index.html", "overview.png", "IH4/field.png", "IH4/tiling.png"} <= known
    assert folder_names(["IH4", "IH4"]) == ["IH4", "IH4-2"]


def test_a_sheet_shows_stars_and_how_tiles_lie(target: Target, bent: EscherTile) -> None:
    sheets = {overview_png([bent.changed(rating=rating)], [target]) for rating in (
        None, Rating(1.0), Rating(3.5), Rating(4.0)
    )}  # fmt: skip
    assert len(sheets) == 4


def test_one_set_of_commands_for_the_tile_that_is_chosen(
    target: Target, bent: EscherTile, flowed: EscherTile, tmp_path: Path, browser: Any
) -> None:
    refused = flowed.changed(tile=replace(flowed.tile, polygon=flowed.tile.polygon * (1.0, 1.1)))
    names = ["IH4", "IH6"]
    (tmp_path / "index.html").write_text(index_page([bent, refused], [target], names), "utf-8")
    page = browser.new_page()
    page.goto((tmp_path / "index.html").as_uri())
    shown = "article:visible h2"
    assert page.locator(shown).count() == 1
    assert "IH4" in page.locator(shown).inner_text()
    page.get_by_role("radio", name="2. IH6").check(force=True)
    assert "IH6" in page.locator(shown).inner_text()
    first = page.locator(".make code").first.inner_text()
    assert f"{tmp_path}/IH6 --force --for laser -o " in first
    assert first.rstrip("'").endswith("-IH6.svg")
    page.goto((tmp_path / "index.html").as_uri() + "#IH4")
    page.reload()
    assert "--force" not in page.locator(".make code").first.inner_text()
    page.emulate_media(media="print")  # on paper are all
    assert page.locator(shown).count() == 2
    page.close()
