"""How long `fractal-render` takes for films and a large still, beside an older version in a checkout of its own.

    python -m benchmarks.films OLDER                                            OLDER: a checkout with its .venv
    python -m benchmarks.films OLDER --record benchmarks/results/films.jsonl
    python -m benchmarks.films --record benchmarks/results/films.jsonl          how noisy frames are, beside stills

Each version draws each work once, in turn, after a small film that compiles its kernels. Seconds are of the whole
command: wall time, and the processor's time with that of ffmpeg, which depends less on what else the machine does. The
record holds the machine's load (the mean number of processes that want a processor).

Noise is judged in views that stand still: the PSNR of a frame, and of a still, against the mean of other stills, and
the standard deviation over time of a pixel and of a block of 45² pixels, in levels of 255.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from fractal_exp import View, codes, render
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.rendering.film import frames
from fractal_exp.runtime import threads
from fractal_exp.suite import random_suite

from . import record

SIDE, BLOCK, FRAMES = 360, 45, 12

WORKS = {
    "film: fern, a million times closer, 12 s at 720": ("fern", "a.mp4", "--zoom", "1e6"),
    "film: gasket, 3 s at 360": ("sierpinski_triangle", "b.mp4", "--seconds", "3", "--size", "360"),
    "film: fern to dragon, 4 s at 360": ("fern", "heighway_dragon", "c.mp4", "--size", "360"),
    "still: fern at 4096": ("fern", "d.png", "--size", "4096"),
}
WARM_UP = ("fern", "warm.mp4", "--size", "64", "--seconds", "0.2", "--points", "1e5", "--center", "0.3", "0.7")
RENDER = "from fractal_exp.cli.render import main; main()"


def draw(checkout: Path, arguments: tuple[str, ...], folder: Path) -> dict[str, float]:
    """Wall and processor seconds of one command, which leaves nothing in the checkout."""
    own = {"NUMBA_CACHE_DIR": str(folder / "kernels"), "PYTHONDONTWRITEBYTECODE": "1"}
    started = time.perf_counter()
    process = subprocess.Popen([checkout / ".venv/bin/python", "-c", RENDER, *arguments], cwd=folder,
                               env=os.environ | own, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        sys.exit(f"{checkout}: fractal-render {' '.join(arguments)} ended with status {process.returncode}")
    return {"wall": time.perf_counter() - started, "processor": used.ru_utime + used.ru_stime}


def noise(code: IFS, view: View) -> dict[str, dict[str, float]]:
    """How noisy frames of a film are, and as many stills."""
    def stills(first: int, count: int) -> np.ndarray:
        return np.stack([render(code, view, resolution=SIDE, seed=first + k).numpy() for k in range(count)])

    truth = stills(1000, 2 * FRAMES).mean(0)
    result = {}
    for name, drawn in (("stills", stills(100, FRAMES)),
                        ("frames", np.stack(list(frames(code, [view] * FRAMES, resolution=SIDE))))):
        blocks = drawn.reshape(FRAMES, SIDE // BLOCK, BLOCK, SIDE // BLOCK, BLOCK).mean((2, 4)).std(0, ddof=1)
        result[name] = {"psnr": float((-10 * np.log10(((drawn - truth)**2).mean((1, 2)))).mean()),
                        "pixel": 255 * float(drawn.std(0, ddof=1).mean()), "block": 255 * float(blocks.mean()),
                        "worst block": 255 * float(blocks.max())}
    return result


def judge(file: Path | None) -> None:
    """Compare the noise of frames and stills for a few codes, whole and from near."""
    rows, named = [], {name: codes.known(name) for name in ("fern", "sierpinski_triangle", "heighway_dragon")}
    for name, code in (named | {"suite 3": random_suite(4)[3]}).items():
        code = attractor.normalize(code)
        for view in (View(), View(attractor.random_point(code, 3), 30), View(attractor.random_point(code, 3), 1e4)):
            rows.append({"code": name, "zoom": view.zoom, **noise(code, view)})
            print(rows[-1], flush=True)
    if file:
        ratios = {f"{kind}: frames' standard deviation over stills'":
                  float(np.mean([row["frames"][kind] / row["stills"][kind] for row in rows]))
                  for kind in ("pixel", "block", "worst block")}
        record.append(file, "films_noise", {"views": rows}, ratios)


def main() -> None:
    """Measure, print, record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("older", type=Path, nargs="?", help="a checkout with an environment of its own in .venv")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    options = parser.parse_args()
    if options.older is None:
        threads.use()
        judge(options.record)
    else:
        compare(options.older, options.record)


def compare(older: Path, file: Path | None) -> None:
    """Time both versions."""
    checkouts = {"older": older.absolute(), "this": Path(__file__).parents[1]}
    commits = {name: subprocess.run(["git", "-C", checkout, "rev-parse", "HEAD"], capture_output=True, text=True,
                                    check=True).stdout.strip() for name, checkout in checkouts.items()}
    rows, before = [], os.getloadavg()
    with TemporaryDirectory() as place:
        folders = {name: Path(place) / name for name in checkouts}
        for name, folder in folders.items():
            folder.mkdir()
            draw(checkouts[name], WARM_UP, folder)
        for work, arguments in WORKS.items():
            took = {name: draw(checkouts[name], arguments, folders[name]) for name in checkouts}
            rows.append({"work": work, **took})
            print(f"{work:<50}" + "".join(f"{name:>8}: wall {each['wall']:6.1f} s, processor {each['processor']:6.1f} s"
                                          for name, each in took.items()), flush=True)
    if file:
        ratios = {f"{row['work']}: {kind} time over {commits['older'][:7]}'s": row["this"][kind] / row["older"][kind]
                  for row in rows for kind in ("processor", "wall")}
        record.append(file, "films", {"commits": commits, "works": rows, "load_before": before,
                                      "load_after": os.getloadavg()}, ratios)


if __name__ == "__main__":
    main()
