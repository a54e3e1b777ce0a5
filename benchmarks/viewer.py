"""The page of a code beside `render`: how alike their stills are, and how long the page takes without a GPU.

    python -m benchmarks.viewer                      some minutes; needs playwright and tests/browser/install.sh
    python -m benchmarks.viewer --record benchmarks/results/viewer.jsonl
    python -m benchmarks.viewer --dragging           how soon the attractor follows a map that is dragged; --record too

Ten codes at 256² pixels in Debian's Chromium with software rendering: the whole, and 64, 10⁶ and 10⁹ times closer about
a point of the attractor with much to see around it up to 10⁶. F1 is that of the lit pixels against `render`, beside
that of `render` with another seed; seconds are from opening the file to the finished picture, the browser being there.

Dragging: from a pointer's movement to the end of drawing the attractor of the code as it then is, at the first showing
of it, with the points that were thrown until then. Its record has the machine's load (the mean number of processes that
ran or waited, over a minute) before and after, as other programs delay what is timed in milliseconds.
"""

from __future__ import annotations

import argparse
import io
import math
import os
import statistics
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import torch
from PIL import Image

from fractal_exp import IFS, View, codes, render, suite
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs import attractor
from fractal_exp.rendering.zoom import rich_point

from . import record

CHROMIUM = "/usr/bin/chromium"
QUIET = ["--headless", "--no-sandbox", "--disable-gpu", "--use-angle=swiftshader", "--enable-unsafe-swiftshader",
         "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
         "--disable-sync"]
CLASSICS = ("fern", "heighway_dragon", "koch_snowflake", "sierpinski_triangle", "maple_leaf", "tree", "spiral",
            "levy_c_curve", "culcita")
INDEX = 11  # of the random suite: six maps that overlap, one of them slow
ZOOMS = (1.0, 64.0, 1e6, 1e9)
SIDE = 256
DRAG_SIDE, DRAGS = 800, 80  # pixels; movements


def chosen() -> dict[str, IFS]:
    """The codes by name, on the canvas."""
    given = {name: codes.known(name) for name in CLASSICS} | {f"suite:{INDEX}": suite.random_suite(INDEX + 1)[INDEX]}
    return {name: attractor.normalize(code) for name, code in given.items()}


def still(browser: Any, path: Path, view: View, thrower: str) -> tuple[torch.Tensor, float]:
    """The picture (S,S) that a page saves of a view, and the seconds until it was done."""
    context = browser.new_context(viewport={"width": SIDE, "height": SIDE}, color_scheme="dark")
    page, (x, y) = context.new_page(), view.center
    started = time.perf_counter()
    page.goto(f"file://{path}?thrower={thrower}#x={x!r}&y={y!r}&zoom={view.zoom!r}")
    page.wait_for_selector('html[data-state="done"]', state="attached", timeout=120_000)
    seconds = time.perf_counter() - started
    with page.expect_download() as download:
        page.keyboard.press("s")
    levels = np.asarray(Image.open(io.BytesIO(Path(download.value.path()).read_bytes())).convert("L"))
    context.close()
    return torch.tensor(levels / 255, dtype=torch.float32), seconds


def measure(browser: Any, thrower: str) -> list[dict[str, Any]]:
    """A row for each code and zoom."""
    rows = []
    with TemporaryDirectory() as folder:
        for number, (name, code) in enumerate(chosen().items()):
            path = code.save_html(Path(folder) / f"{number}.html")
            point = rich_point(code, end_zoom=1e6)
            for zoom in ZOOMS:
                view = View(point if zoom > 1 else (0.0, 0.0), zoom)
                drawn, seconds = still(browser, path, view, thrower)
                truth, again = (render(code, view, resolution=SIDE, seed=seed)[None] for seed in (0, 1))
                rows.append({"code": name, "zoom": zoom, "f1": float(f1(drawn[None], truth)),
                             "f1_of_another_seed": float(f1(again, truth)), "mean": float(drawn.mean()),
                             "mean_of_render": float(truth.mean()), "lit": float((drawn > 0).float().mean()),
                             "seconds": seconds, "bytes": path.stat().st_size})
                print("  ".join(f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                                for key, value in rows[-1].items()), flush=True)
    return rows


WATCH = """(() => {
  let moved = 0;
  window.followed = [];
  addEventListener("pointermove", (event) => { moved ||= event.timeStamp; }, true);
  const kind = WebGL2RenderingContext.prototype, draw = kind.drawArrays;
  kind.drawArrays = function (mode, ...rest) {
    draw.call(this, mode, ...rest);
    if (mode !== this.TRIANGLES || !moved) return;
    this.finish();
    const took = performance.now() - moved;
    moved = 0;
    queueMicrotask(() => {
      const told = document.getElementById("points").textContent, million = told.includes("million");
      window.followed.push([took, million ? 1e6 * parseFloat(told) : Number(told.replace(/\\D/g, ""))]);
    });
  };
})()"""  # the attractor is shown by a triangle over the canvas


def dragging(browser: Any, thrower: str) -> list[dict[str, Any]]:
    """A row for each code: milliseconds from a pointer's movement to the attractor that follows it."""
    rows = []
    with TemporaryDirectory() as folder:
        for number, (name, code) in enumerate(chosen().items()):
            path = code.save_html(Path(folder) / f"{number}.html")
            context = browser.new_context(viewport={"width": DRAG_SIDE, "height": DRAG_SIDE}, bypass_csp=True)
            context.add_init_script(WATCH)
            page = context.new_page()
            page.goto(f"file://{path}?thrower={thrower}")
            page.wait_for_selector('html[data-state="done"]', state="attached", timeout=120_000)
            page.keyboard.press("e")
            page.wait_for_timeout(500)
            box = page.locator("#handle-move .plate").bounding_box()
            x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
            page.mouse.move(x, y)
            page.mouse.down()
            page.evaluate("window.followed.length = 0")
            for k in range(1, DRAGS + 1):
                page.mouse.move(x + 40 * math.sin(k / 5), y + 40 * (math.cos(k / 5) - 1))
                page.wait_for_timeout(30)
            page.mouse.up()
            took, points = zip(*page.evaluate("window.followed")[10:], strict=True)
            rows.append({"code": name, "maps": len(code), "median_ms": statistics.median(took),
                         "p95_ms": sorted(took)[int(0.95 * len(took))], "least_points": min(points)})
            print(rows[-1], flush=True)
            context.close()
    return rows


def main() -> None:
    """Measure, print, record."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path, help="file of JSON lines to add the result to")
    parser.add_argument("--thrower", choices=("cpu", "gpu"), default="cpu",
                        help="what throws the points: the processor, as a page chooses by itself without a GPU, or the "
                             "shaders, in software")
    parser.add_argument("--dragging", action="store_true", help="how soon the attractor follows a dragged map, instead")
    options = parser.parse_args()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        load = os.getloadavg()
        rows = (dragging if options.dragging else measure)(browser, options.thrower)
        browser.close()
    if options.dragging:
        ratios = {"median ms": statistics.median(row["median_ms"] for row in rows),
                  "slowest code's 95th percentile ms": max(row["p95_ms"] for row in rows),
                  "least points": float(min(row["least_points"] for row in rows))}
        print(ratios, f"load before {load[0]:.1f}, after {os.getloadavg()[0]:.1f}")
        if options.record:
            record.append(options.record, "viewer_dragging", {"thrower": options.thrower, "side": DRAG_SIDE,
                                                              "codes": rows, "load_before": load,
                                                              "load_after": os.getloadavg()}, ratios)
        return
    near = [row for row in rows if row["zoom"] <= 1e6]
    ratios = {"least F1 up to a million times": min(row["f1"] for row in near),
              "mean F1 up to a million times": statistics.mean(row["f1"] for row in near),
              "least lit share": min(row["lit"] for row in rows)}
    print(ratios, f"median {statistics.median(row['seconds'] for row in rows):.2f} s, "
                  f"longest {max(row['seconds'] for row in rows):.2f} s")
    if options.record:
        record.append(options.record, "viewer", {"thrower": options.thrower, "side": SIDE, "stills": rows}, ratios)


if __name__ == "__main__":
    main()
