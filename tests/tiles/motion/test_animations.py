"""Animations: loops of the length asked for, full of tiles, in files that say so."""

import io
import itertools
import re
import stat
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageSequence

from orbiflow.drawing import palette
from orbiflow.errors import CertificationError, SettingError
from orbiflow.runtime import (
    Call,
    Cancel,
    Cancelled,
    Event,
    Note,
    Progress,
    Written,
    call_from_json,
    find,
)
from orbiflow.tiles import (
    AnimationSettings,
    EscherTile,
    LikenessSearch,
    Target,
    Tile,
    animate,
    animation,
    as_tile,
    border,
    escherize_class,
)
from orbiflow.tiles.motifs import CarriedPicture, Over
from orbiflow.tiles.motion.kinds import BendingWay, frames, motion
from orbiflow.tiles.motion.writers import frame_image, frame_scene
from orbiflow.tiles.write import scene_image
from refusals import refused
from runtime.searches import check_order
from small_searches import FEW
from swirled_tiles import is_sound, swirled, swirled_tile

BOOT = [(60, 20), (210, 20), (230, 80), (170, 95), (160, 190), (100, 145), (45, 80)]
SVG = "{http://www.w3.org/2000/svg}"
SMALL = {"seconds": 1.0, "fps": 10.0, "area": "120x80px"}


@pytest.fixture(scope="module", name="bent")
def bent_fixture() -> EscherTile:
    found = escherize_class(Target.from_polygon(BOOT, y_down=True), "IH4", LikenessSearch(**FEW))
    assert isinstance(found, EscherTile)
    return found


@settings(max_examples=8)
@given(
    swirled, st.floats(0, 1), st.booleans(), st.sampled_from(["90x160px", "150x150px", "150x100px"])
)
def test_every_picture_of_a_morph_is_full(tile: Tile, share, steady, area) -> None:
    assume(is_sound(tile))
    moving = motion(as_tile(tile), AnimationSettings(area=area, format="svg" if steady else None))
    own = palette("lagoon")._replace(paper="#ff00ff")
    image = np.asarray(scene_image(frame_scene(moving, own, share))).astype(int)
    paper = np.abs(image - (255, 0, 255)).max(axis=-1) < 40
    assert paper.sum() == 0
    assert len(moving.colours) == len(moving.places(share).offset)


@given(st.floats(0.5, 20), st.floats(1, 40))
def test_a_loop_lasts_as_long_as_asked(seconds: float, fps: float) -> None:
    shares, lengths = zip(*frames(seconds, fps), strict=True)
    assert sum(lengths) == pytest.approx(seconds)
    assert shares[0] == 0
    assert shares[1:] == shares[:0:-1]
    assert max(shares) == 1


@pytest.mark.parametrize("kind", ["morph", "bend", "grow"])
def test_a_gif(bent: EscherTile, kind, tmp_path: Path) -> None:
    out = tmp_path / "a.gif"
    animate(bent, out, AnimationSettings(kind=kind, **SMALL))
    with Image.open(out) as image:
        assert image.size == (120, 80)
        assert image.info["loop"] == 0
        shown = [np.asarray(f.convert("RGB")).astype(int) for f in ImageSequence.Iterator(image)]
        lasting = [f.info["duration"] for f in ImageSequence.Iterator(image)]
    assert sum(lasting) == pytest.approx(1000, abs=30)
    middle = len(shown) // 2
    assert np.abs(shown[0] - shown[middle]).mean() > 5  # something is seen to move
    assert np.abs(shown[1] - shown[-1]).max() == 0  # there and back
    assert [path.name for path in tmp_path.iterdir()] == ["a.gif"]


def numbers(text: str | None) -> list[float]:
    return [float(value) for value in (text or "").split(";")]


@pytest.mark.parametrize("kind", ["morph", "bend", "grow"])
def test_an_svg(bent: EscherTile, kind) -> None:
    text = animation(bent, AnimationSettings(format="svg", kind=kind))
    assert isinstance(text, str)
    assert "prefers-reduced-motion: reduce" in text
    assert "<script" not in text
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
    root = ElementTree.fromstring(text)
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(set(ids)) == len(ids)
    assert all(name and name.startswith("ih4-") for name in ids)
    assert {e.get("href", "")[1:] for e in root.iter(f"{SVG}use")} <= set(ids)
    moving = [e for name in ("animate", "animateTransform") for e in root.iter(SVG + name)]
    assert moving
    for element in moving:
        times = numbers(element.get("keyTimes"))
        values = (element.get("values") or "").split(";")
        assert len(times) == len(values)
        assert times == sorted(times)
        assert (times[0], times[-1]) == (0, 1)
        assert values[0] == values[-1]
        splines = element.get("keySplines")
        assert splines is None or len(splines.split(";")) == len(times) - 1
        if element.get("attributeName") == "d":
            assert len({len(re.findall(",", value)) for value in values}) == 1
    groups = {e.get("class"): e for e in root.iter(f"{SVG}g") if e.get("class")}
    uses = [sum(1 for _ in groups[name].iter(f"{SVG}use")) for name in ("moving", "still")]
    assert uses[0] == uses[1] > 5
    assert len(text) < 500_000


@pytest.mark.parametrize("name", ["IH1", "IH5"])
def test_colours_of_neighbours_differ_throughout(name: str) -> None:
    settings: dict[str, Any] = {"area": "200x134px"}
    moving = motion(as_tile(swirled_tile(name, 3, 0.1)), AnimationSettings(**settings))
    for share in (0.0, 0.5, 1.0):
        shown = [(shapely.Polygon(own.ring), own.colour) for own in moving.seen(share)]
        size = shown[0][0].area ** 0.5
        beside = 0
        for (one, own), (other, its) in itertools.combinations(shown, 2):
            shared = one.buffer(1e-3 * size).intersection(other.buffer(1e-3 * size)).area
            if shared > 0.05 * 2e-3 * size * size:
                beside += 1
                assert own != its
            assert one.intersection(other).area < 1e-6 * size**2
        assert beside > len(shown)


def test_a_silhouette_bends_from_rest_to_tile(bent: EscherTile) -> None:
    bending = bent.bending
    assert bending is not None
    way = BendingWay(bending)
    assert np.abs(way.at(0.0) - bending.rest).max() < 1e-9
    assert np.abs(way.at(1.0) - bending.images).max() < 1e-9
    whole = motion(bent, AnimationSettings(kind="bend", **{**SMALL, "area": "200x134px"}))
    ring = whole.outlines(1.0)[0] @ whole.places(1.0).linear[0].T + whole.places(1.0).offset[0]
    assert ring.min() > 0
    assert whole.grown(0.0).tolist()[0] == 1
    assert whole.grown(0.0)[1:].max() == 0
    assert whole.grown(1.0).min() == 1


@pytest.mark.parametrize("kind", ["morph", "bend", "grow"])
@pytest.mark.parametrize("share", [0.45, 1.0])
def test_what_lies_on_the_tiles_goes_where_their_bodies_go(bent, kind: Any, share: float) -> None:
    low, high = bent.covered.low, bent.covered.high
    shades = np.stack(np.meshgrid(*[np.linspace(0, 255, 64)] * 2), axis=-1)
    image = np.dstack([shades, np.full((64, 64), 128.0), np.full((64, 64), 255.0)])
    over = Over(CarriedPicture(Image.fromarray(image.astype(np.uint8), "RGBA"), bent.covered))
    page: Any = {"area": "360x240px", "tile_size": "120px", "outline": "none"}
    chosen = AnimationSettings(kind=kind, **page)
    moving = motion(bent, chosen, over)
    assert moving.dress is not None
    bending, frame = bent.require_map()
    inner = np.setdiff1d(np.arange(len(bending.rest)), border(bending.triangles))
    shares = (frame.to_input(bending.rest[inner]) - low) / (high - low)
    expected = np.column_stack([255 * shares, np.full(len(inner), 128.0)])
    drawn = np.asarray(frame_image(moving, moving.palette(chosen), share)).astype(float)
    body = moving.bodies(share)[0][inner]
    every = (own for own in moving.seen(share) if own.whole)  # which lie above those that grow
    copy = min(every, key=lambda own: np.linalg.norm(own.offset - np.array(moving.page.size) / 2))
    x, y = (body @ copy.linear.T + copy.offset).T
    shown = (x > 0) & (x < drawn.shape[1]) & (y > 0) & (y < drawn.shape[0])
    seen = drawn[y[shown].astype(int), x[shown].astype(int)]
    apart = np.abs(seen - expected[shown]).max(axis=1)
    assert shown.sum() > 5
    assert np.median(apart) < 4
    assert np.quantile(apart, 0.9) < 16  # where the body is narrow, a pixel is many shades


def test_frames_with_a_picture_are_full_and_of_one_palette(bent: EscherTile) -> None:
    over = Over(CarriedPicture(Image.new("RGBA", (16, 16), (200, 30, 60, 255)), bent.covered))
    plain = palette("lagoon")._replace(paper="#ff00ff")
    for share in (0.0, 0.3, 1.0):
        frame = frame_image(motion(bent, AnimationSettings(), over), plain, share)
        assert (np.abs(np.asarray(frame).astype(int) - (255, 0, 255)).max(axis=-1) > 40).all()
    content = animation(bent, AnimationSettings(kind="grow", eyes=((150, 60, 8),), **SMALL), over)
    assert isinstance(content, bytes)
    shown = [
        np.asarray(one.convert("RGB")).astype(int)
        for one in ImageSequence.Iterator(Image.open(io.BytesIO(content)))
    ]
    red = [(np.abs(one - (200, 30, 60)).max(axis=-1) < 12).mean() for one in shown]
    assert red[0] > 0.02
    assert max(red) > 0.3


def test_an_animated_svg_says_that_it_has_no_pictures(bent: EscherTile, tmp_path: Path) -> None:
    with refused("strokes", ".gif", kind=SettingError):
        AnimationSettings(format="svg", eyes=((150, 60),))
    picture = tmp_path / "own.png"
    Image.new("RGB", (10, 10)).save(picture)
    with refused("picture", ".gif", kind=SettingError):
        animate(bent, tmp_path / "out.svg", picture=picture)
    with refused("second_picture", kind=SettingError):
        animate(bent, tmp_path / "out.gif", second_picture=picture)


def test_what_cannot_be_animated_says_why(bent: EscherTile, monkeypatch) -> None:
    plain = Tile(bent.tile.polygon, bent.tile.group)
    with refused("class"):
        animation(plain, AnimationSettings(**SMALL))
    with refused("kind", "morph"):
        animation(EscherTile(bent.tile), AnimationSettings(kind="bend", **SMALL))
    crossed = Tile(0.9 * bent.tile.polygon, bent.tile.group, "IH4")
    with refused("IH4", "force", kind=CertificationError):
        animation(crossed, AnimationSettings(**SMALL))
    monkeypatch.setenv("PATH", "")
    with refused("ffmpeg", ".gif"):
        animation(bent, AnimationSettings(format="mp4", **SMALL))


@pytest.mark.parametrize(
    ("bad", "about"),
    [
        *(({"format": "webm"}, "format"), ({"kind": "jump"}, "kind")),
        *(({"seconds": 0}, "seconds"), ({"fps": 1000}, "fps")),
        ({"area": "801x534px", "format": "mp4"}, "801 x 534"),
        *(({"area": "60x40px"}, "8000 pixels"), ({"kind": "morph", "clip": False}, "clip")),
        *(({"area": 1.5}, "area"), ({"palette": "mud"}, "palette")),
        ({"format": "gif", "seconds": 120, "fps": 60}, 2400),
    ],
)
def test_settings_that_cannot_be_used(bad, about: object) -> None:
    with refused(about):
        AnimationSettings(**bad)


FFMPEG = """#!/bin/sh
for last; do :; done
{ echo "$@"; wc -c; } > "$last"
"""


def test_an_mp4_is_what_ffmpeg_makes_of_all_frames(bent: EscherTile, tmp_path, monkeypatch) -> None:
    fake = tmp_path / "bin" / "ffmpeg"
    fake.parent.mkdir()
    fake.write_text(FFMPEG)
    fake.chmod(fake.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{fake.parent}:/usr/bin:/bin")
    made = animation(bent, AnimationSettings(format="mp4", **SMALL))
    assert isinstance(made, bytes)
    said, size = io.BytesIO(made).read().decode().splitlines()
    assert "-s 120x80 -r 10" in said
    count, rest = divmod(int(size), 120 * 80 * 3)
    assert rest == 0
    assert count == pytest.approx(10, abs=2)
    fake.write_text("#!/bin/sh\necho 'no such codec' >&2\nexit 1\n")
    with refused("ffmpeg", "no such codec"):
        animation(bent, AnimationSettings(format="mp4", **SMALL))


OPERATION_BOOT = "[[60, 20], [210, 20], [230, 80], [170, 95], [160, 190], [100, 145], [45, 80]]"


@pytest.fixture(scope="module", name="folder")
def folder_fixture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("run")
    (folder / "boot.json").write_text(OPERATION_BOOT)
    given = {"classes": ["IH4", "IH6"], "method": "occupancy", "turns": 1, "iterations": 4}
    find("escherize").call({"image": folder / "boot.json", "out": folder / "out", **given}).run()
    return folder / "out"


def animation_of_operation(**given: object) -> Call:
    return find("animate").call(given)


def small(folder: Path, out: Path | None, **given: object) -> Call:
    own = {} if out is None else {"out": out}
    return animation_of_operation(result=folder, seconds=1.0, area="96x64px", **own, **given)


def test_a_file_is_written_and_told_of(folder: Path, tmp_path: Path) -> None:
    events: list[Event] = []
    out = tmp_path / "loop.gif"
    request = small(folder, out, tile="IH6", fps=8.0, palette="ink")
    assert call_from_json(request.to_json()).to_json() == request.to_json()
    finished = request.run(events.append)
    check_order(events)
    assert [event.path for event in events if isinstance(event, Written)] == [out]
    assert any("morph of IH6" in event.text for event in events if isinstance(event, Note))
    assert finished.summary["class"] == "IH6"
    assert finished.summary["bytes"] == out.stat().st_size
    with Image.open(out) as image:
        assert image.size == (96, 64)


def test_a_cancelled_one_writes_nothing(folder: Path, tmp_path: Path) -> None:
    cancel = Cancel()

    def sink(event: Event) -> None:
        if isinstance(event, Progress):
            cancel.cancel()

    with pytest.raises(Cancelled):
        small(folder, tmp_path / "a.gif").run(sink, cancel)
    assert list(tmp_path.iterdir()) == []


def test_mistakes_are_said_before_the_work(folder: Path, tmp_path: Path) -> None:
    for request, name in (
        (small(folder, tmp_path / "none" / "a.gif"), "none"),
        (small(folder, tmp_path / "a.gif", tile="IH1"), "IH1"),
        (small(folder, tmp_path / "a.gif", kind="bend"), "kind"),
        (small(tmp_path, tmp_path / "a.gif"), "result.json"),
    ):
        with refused(name):
            request.run()
    assert list(tmp_path.iterdir()) == []
