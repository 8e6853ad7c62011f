"""A browser's window as frames of a film, with a pointer; and where things are in it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

from PIL import Image, ImageChops, ImageDraw
from playwright.sync_api import Page

EYE, BACK = (57.0, 54.0), (140.0, 90.0)  # of the turtle, in pixels of its picture
COMMON, RARE = 112, 140  # colours of the film: of surfaces, and of small things such as pens
POINTER = ((0, 0), (0, 21), (5, 16), (9, 25), (13, 23), (9, 15), (16, 15))
VIEW = """async ([tile, place, across]) => {
    const { Camera, Tiling } = await import("/drawing/js/tiling.js");
    const view = await (await fetch(tile)).json();
    const { x, y, width, height } = document.querySelector(place).getBoundingClientRect();
    const tiling = new Tiling(view), camera = Camera.fit(tiling, width, height, across);
    const [a, b, c, d, e, f] = camera.matrix(width, height);
    const seen = ([u, v]) => [x + a * u + c * v + e, y + b * u + d * v + f];
    const { images } = view.map, rest = view.map.rest;
    return { outline: view.polygon.map(seen), rest, images: images.map(seen) };
}"""


def centre(page: Page, selector: str) -> tuple[float, float]:
    """Return where the middle of an element is in the window."""
    own = page.locator(selector).first
    own.wait_for()
    own.scroll_into_view_if_needed()
    box = own.bounding_box()
    assert box
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


def tile_in_window(page: Page, across: float = 4.0) -> dict[str, Any]:
    """Return the outline of the tile that is shown, and where its map takes points, in the window."""
    _, project, _, tile = page.url.rsplit("/", 3)
    place = f"/api/projects/{project}/tiles/{tile}"
    return page.evaluate(VIEW, [place, ".closeup-canvas", across])


def in_window(page: Page, place: tuple[float, float]) -> tuple[float, float]:
    """Return where the tile in the middle of the window has a point of the picture that was read."""
    seen = tile_in_window(page)
    x, y = seen["images"][nearest(seen["rest"], place)]
    return x, y


def outline_in_window(page: Page, place: tuple[float, float]) -> tuple[float, float]:
    """Return the point of that tile's outline that is nearest to a point of the picture."""
    outline = tile_in_window(page)["outline"]
    x, y = outline[nearest(outline, in_window(page, place))]
    return x, y


def nearest(points: list[tuple[float, float]], place: tuple[float, float]) -> int:
    """Return the number of the nearest of many points."""
    apart = [(x - place[0]) ** 2 + (y - place[1]) ** 2 for x, y in points]
    return apart.index(min(apart))


def shared_palette(picture: Image.Image) -> Image.Image:
    """Return a picture whose palette has the commonest colours of a picture, and some of each kind."""
    common = picture.quantize(COMMON).getpalette() or []
    rare = picture.quantize(RARE, method=Image.Quantize.MAXCOVERAGE).getpalette() or []
    palette = Image.new("P", (1, 1))
    palette.putpalette([*common[: 3 * COMMON], *rare[: 3 * RARE]])
    return palette


class Film:
    """Frames of what a page shows while a pointer does things in it."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.pointer = (700.0, 600.0)
        self.pressed = False
        self.carried: Image.Image | None = None
        self.frames: list[tuple[Image.Image, int]] = []
        self._samples: list[Image.Image] = []

    def go(self, x: float, y: float, frames: int = 5) -> None:
        """Move the pointer, slowly at both ends."""
        u, v = self.pointer
        for k in range(1, frames + 1):
            share = k / frames
            share *= share * (3 - 2 * share)
            self.pointer = u + share * (x - u), v + share * (y - v)
            self.page.mouse.move(*self.pointer)
            self.rest(50)

    def click(self, x: float, y: float) -> None:
        """Go somewhere and click."""
        self.go(x, y)
        self.pressed = True
        self.rest(120)
        self.pressed = False
        self.page.mouse.click(x, y)

    def rest(self, milliseconds: int) -> None:
        """Add what is seen now, for some time."""
        self.frames.append((self._seen(), milliseconds))

    def sample(self) -> None:
        """Remember what is seen now, if it is news."""
        seen = self._seen()
        if not self._samples or ImageChops.difference(seen, self._samples[-1]).getbbox():
            self._samples.append(seen)

    def keep_samples(self, count: int, milliseconds: int) -> None:
        """Add that many of the pictures that were remembered, from the first to the last."""
        last = len(self._samples) - 1
        chosen = sorted({round(k * last / (count - 1)) for k in range(count)})
        self.frames += [(self._samples[k], milliseconds) for k in chosen]

    def write(self, path: Path, width: int, seconds: float) -> None:
        """Write an animation of a length, without end, in colours that all its frames share."""
        small = [
            frame.resize(
                (width, round(width * frame.height / frame.width)), Image.Resampling.LANCZOS
            )
            for frame, _ in self.frames
        ]
        strip = Image.new("RGB", (width, len(small[::6]) * small[0].height))
        for k, frame in enumerate(small[::6]):
            strip.paste(frame, (0, k * frame.height))
        palette = shared_palette(strip)
        first, *rest = (
            frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small
        )
        speed = sum(milliseconds for _, milliseconds in self.frames) / (1000 * seconds)
        durations = [10 * max(2, round(lasts / speed / 10)) for _, lasts in self.frames]
        first.save(
            path, save_all=True, append_images=rest, duration=durations, loop=0, optimize=True
        )

    def _seen(self) -> Image.Image:
        with Image.open(io.BytesIO(self.page.screenshot())) as shot:
            frame = shot.convert("RGB")
        x, y = (round(place) for place in self.pointer)
        if self.carried:
            frame.paste(self.carried.convert("L"), (x - 65, y - 110), self.carried.getchannel("A"))
        draw = ImageDraw.Draw(frame)
        if self.pressed:
            draw.ellipse((x - 16, y - 16, x + 16, y + 16), outline="#0b6b66", width=4)
        draw.polygon([(x + u, y + v) for u, v in POINTER], fill="black", outline="white", width=2)
        return frame
