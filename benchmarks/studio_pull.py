"""How fast a tiling follows while a point of its outline is pulled, in headless Chromium.

    python benchmarks/studio_pull.py [--vertices 500] [--seconds 5] [--across 4]

A tile of the turtle is pulled to and fro as the close-up of the studio does it, and the whole tiling
is painted at each frame, without a graphics processor. Printed are frames a second, and what a frame
costs. A machine that is busy with other things shows fewer frames; what one core would show if it were
free is told from the processor time of all processes of the browser.
"""

from __future__ import annotations

import argparse
import json
import mimetypes
import os
from pathlib import Path
from typing import Any

from orbiflow.studio import pulled_tiles
from orbiflow.studio.tile_view import tile_card, tile_view
from orbiflow.tiles import EscherizeSettings, EscherTile, Target, escherize

HERE = Path(__file__).parents[1]
STATIC = HERE / "src" / "orbiflow" / "studio" / "static"
PAGE = """<!doctype html><link rel="stylesheet" href="css/base.css">
<link rel="stylesheet" href="css/closeup.css">
<style>.closeup-stage { position: fixed; inset: 0; height: 100vh }</style><body></body>"""
READY = """async ([view, space, palette, across]) => {
  const { LiveTiling } = await import("./js/closeup/live.js");
  const { Stage } = await import("./js/closeup/stage.js");
  const { Puller } = await import("./js/closeup/pull.js");
  const { crosses } = await import("./js/closeup/crossing.js");
  const stage = new Stage({ label: "tiling", help: "", tool: () => null });
  document.body.append(stage.box);
  const tiling = new LiveTiling(view);
  tiling.outline(space.polygon);
  stage.options.palette = palette;
  stage.show(tiling);
  stage.fit(across);
  const puller = new Puller(space);
  const size = Math.sqrt(puller.area);
  puller.grab(Math.floor(puller.count / 5), 0.3, 0.6 * size);
  const start = puller.held();
  globalThis.ready = { stage, tiling, puller, crosses, start, size };
  await new Promise((resolve) => requestAnimationFrame(resolve));
}"""
PULL = """async (seconds) => {
  const { stage, tiling, puller, crosses, start, size } = globalThis.ready;
  const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
  const found = { frames: 0, pull: 0, paint: 0, longest: 0 };
  Object.assign(found, { vertices: puller.count, points: puller.size });
  const began = performance.now();
  let last = began;
  while (performance.now() - began < 1000 * seconds) {
    const now = await frame();
    const turn = (now - began) / 400;
    const before = performance.now();
    const [x, y] = [Math.sin(turn), 1 - Math.cos(turn)];
    puller.pull([start[0] + 0.05 * size * x, start[1] + 0.05 * size * y]);
    const ring = puller.polygon();
    tiling.place(puller.placement());
    tiling.outline(ring, { exact: false });
    crosses(ring);
    const middle = performance.now();
    stage.paint();
    const after = performance.now();
    found.frames += 1;
    found.pull += middle - before;
    found.paint += after - middle;
    found.longest = Math.max(found.longest, after - last);
    last = after;
  }
  found.copies = stage.copies.length;
  found.seconds = (performance.now() - began) / 1000;
  return found;
}"""


PAN = """async (seconds) => {
  const { stage } = globalThis.ready;
  const began = performance.now();
  const before = stage.frames;
  while (performance.now() - began < 1000 * seconds) {
    stage.pan(3, 2); // which paints at the next frame
    await new Promise((resolve) => requestAnimationFrame(resolve));
  }
  return { frames: stage.frames - before, seconds: (performance.now() - began) / 1000 };
}"""


def turtle() -> EscherTile:
    """Return a tile of the turtle."""
    target = Target.read(HERE / "examples" / "silhouettes" / "turtle.png")
    return escherize(target, EscherizeSettings(effort="fast", classes=("IH4",))).tiles[0]


def with_vertices(tile: EscherTile, count: int) -> dict[str, Any]:
    """Return the space of a tile, its outline divided until it has at least so many vertices."""
    for points in range(count // 2, 2 * count, 10):
        pulled_tiles.POINTS = points
        if len(pulled_tiles.variations(tile).first.polygon) >= count:
            break
    return pulled_tiles.space_json(tile)


def measured(view: dict[str, Any], space: dict[str, Any], seconds: float, across: float) -> dict:
    """Return what the browser measured."""
    from playwright.sync_api import Route, sync_playwright

    def serve(route: Route) -> None:
        path = route.request.url.split("/", 3)[3]
        if path == "bench.html":
            route.fulfill(body=PAGE, content_type="text/html")
        else:
            kind = mimetypes.guess_type(path)[0] or "text/plain"
            route.fulfill(body=(STATIC / path).read_bytes(), content_type=kind)

    palette = {"colours": ["#f4ecdc", "#1d4e79", "#8ab6d9"], "outline": "#14263a"}
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path="/usr/bin/chromium", args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        page.route("http://studio.test/**", serve)
        page.goto("http://studio.test/bench.html")
        page.evaluate(READY, [view, space, palette, across])
        before = processor_seconds()
        found = page.evaluate(PULL, seconds)
        found["processor"] = processor_seconds() - before
        before = processor_seconds()
        found["pan"] = page.evaluate(PAN, seconds)
        found["pan"]["processor"] = processor_seconds() - before
        browser.close()
    return found


def processor_seconds() -> float:
    """Return the processor time of all processes that this one has started, and they in turn."""
    times, parents = {}, {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = file.read_text().rsplit(")", 1)[1].split()
        except OSError:  # it has ended
            continue
        parents[int(file.parent.name)] = int(words[1])
        times[int(file.parent.name)] = int(words[11]) + int(words[12])
    own = {os.getpid()}
    while more := {pid for pid, parent in parents.items() if parent in own} - own:
        own |= more
    return sum(times.get(pid, 0) for pid in own - {os.getpid()}) / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--vertices", type=int, default=500)
    parser.add_argument("--seconds", type=float, default=5.0)
    parser.add_argument("--across", type=float, default=4.0)
    given = parser.parse_args()
    tile = turtle()
    view = json.loads(json.dumps(tile_view(tile_card(tile, 1, "final"), tile)))
    found = measured(view, with_vertices(tile, given.vertices), given.seconds, given.across)
    frames = found["frames"]
    print(
        f"vertices {found['vertices']}, points of the body {found['points']}, copies {found['copies']}"
    )
    print("pulling")
    print(f"frames a second               {frames / found['seconds']:.1f}")
    print(f"with a core to itself         {frames / found['processor']:.1f} (at most 60)")
    print(f"processor time a frame, ms    {1000 * found['processor'] / frames:.1f}")
    print(f"following, ms                 {found['pull'] / frames:.1f}")
    print(f"painting, ms                  {found['paint'] / frames:.1f}")
    print(f"longest frame, ms             {found['longest']:.0f}")
    pan = found["pan"]
    print("panning")
    print(f"frames a second               {pan['frames'] / pan['seconds']:.1f}")
    print(f"with a core to itself         {pan['frames'] / pan['processor']:.1f} (at most 60)")


if __name__ == "__main__":
    main()
