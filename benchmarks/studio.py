"""How soon the studio shows the first code over a picture, in a browser without a GPU.

    python -m benchmarks.studio          a minute; needs the extra studio, playwright and tests/browser/install.sh
    python -m benchmarks.studio --record benchmarks/results/viewer.jsonl

`fractal-studio` is started, and its page is open in Debian's Chromium. The file of a fern that matplotlib drew as a
scatter plot goes to the page's file input, which takes a file as the drop does. *Find* is clicked as soon as it can be.
Seconds count from the file: until the picture is understood, until a code lies over it, and until that drawing, or that
of the next code, has as many points as it gets.
"""

from __future__ import annotations

import argparse
import os
import re
import statistics
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from fractal_exp import codes
from fractal_exp.ifs import attractor

from . import record
from .viewer import CHROMIUM, QUIET

RUNS, PATIENCE = 3, 120_000  # ms
POINTS, SIDE_INCHES, DPI = 60_000, 5, 100


def draw_fern(path: Path) -> Path:
    """A scatter plot of the fern, 500² pixels, as a user of matplotlib would make it."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(SIDE_INCHES, SIDE_INCHES), dpi=DPI)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.scatter(*attractor.random_points(codes.known("fern"), POINTS)[0].T, s=0.3, c="black", linewidths=0)
    axes.set_aspect("equal")
    axes.axis("off")
    figure.savefig(path)
    return path


def run(browser: Any, picture: Path, output: Path) -> dict[str, float]:
    """Seconds from the file to each thing that the page shows, in a studio of its own."""
    command = [sys.executable, "-m", "fractal_exp.cli", "studio", "--port", "0", "--no-browser", "--output",
               str(output)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as studio:
        context = browser.new_context(viewport={"width": 1280, "height": 860})
        try:
            assert studio.stdout is not None
            found = re.search(r"http://\S+", studio.stdout.readline())
            if found is None:
                raise RuntimeError("fractal-studio printed no address; run it by hand to see why")
            page = context.new_page()
            page.goto(found[0])
            page.wait_for_selector("#file:enabled")
            started = time.perf_counter()
            page.set_input_files("#file", picture)
            page.wait_for_selector("#do-find:enabled", timeout=PATIENCE)
            understood = time.perf_counter() - started
            page.click("#do-find")
            page.wait_for_selector("#scores:not([hidden])", timeout=PATIENCE)
            page.wait_for_selector("#picture:not([hidden])", timeout=PATIENCE)
            shown = time.perf_counter() - started
            likeness = float(page.inner_text("#f1"))
            page.wait_for_selector('#stage[data-state="done"]', timeout=PATIENCE)
            return {"understood": understood, "first code": shown, "first F1": likeness,
                    "drawn": time.perf_counter() - started}
        finally:
            context.close()
            studio.terminate()


def main() -> None:
    """Measure, print, record."""
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path, help="file of JSON lines to add the result to")
    options = parser.parse_args()
    load, rows = os.getloadavg(), []
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        picture = draw_fern(Path(folder) / "fern.png")
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=QUIET)
        for number in range(RUNS):
            rows.append(run(browser, picture, Path(folder) / str(number)))
            print(rows[-1], flush=True)
        browser.close()
    ratios = {"median seconds to the first code": statistics.median(row["first code"] for row in rows),
              "longest seconds to the first code": max(row["first code"] for row in rows)}
    print(ratios, f"load before {load[0]:.1f}, after {os.getloadavg()[0]:.1f}")
    if options.record:
        record.append(options.record, "studio_first_code",
                      {"runs": rows, "load_before": load, "load_after": os.getloadavg()}, ratios)


if __name__ == "__main__":
    main()
