"""How many pictures of a data set are drawn and written in a second, beside FractalDB's own renderer.

    python -m benchmarks.datasets                                                     half a minute
    python -m benchmarks.datasets CHECKOUT --record benchmarks/results/datasets.jsonl      two minutes

CHECKOUT: of github.com/hirokatsukataoka16/FractalDB-Pretrained-ResNet-PyTorch, whose renderer and codes are then used.
Without it, the codes are random ones.

Both renderers draw each code in turn as the data set is made: one drawing of 100 000 points at 362², saved as PNG in
four flips. Processor time depends less than wall time on what else the machine does, and the ratio of two that were
taken side by side depends on it least. Rates per second are wall time on all cores, while others may use them too: the
record holds the machine's load (the mean number of processes that want a processor), and `cores` says how many cores'
worth of time the process got.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import os
import time
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image
from torch.utils.data import DataLoader

from fractal_exp import IFS
from fractal_exp.datasets import Fractals, kernels, write
from fractal_exp.datasets.fractals import KINDS, factors
from fractal_exp.ops.histogram.pool import choice
from fractal_exp.rendering.png import of_dots
from fractal_exp.runtime import threads
from fractal_exp.suite import random_suite, target

from . import record

CODES, BESIDE, PICTURES, POINTS = 20, 6, 2000, 100_000
GOAL = 300  # pictures of 256² a second on two cores


def codes_of(checkout: Path | None) -> list[IFS]:
    """Codes of FractalDB, or random ones."""
    if checkout is None:
        return random_suite(CODES, 101)
    tables = [np.loadtxt(path, delimiter=",", ndmin=2) for path in sorted(checkout.glob("data/csv_*/csv*/*.csv"))]
    if not tables:
        raise SystemExit(f"{checkout} has no codes in data; give a checkout of FractalDB-Pretrained-ResNet-PyTorch")
    return [IFS(rows[:, :4].reshape(-1, 2, 2), rows[:, 4:6], rows[:, 6] / rows[:, 6].sum()) for rows in tables]


def stretching(codes: Sequence[IFS]) -> dict[str, Any]:
    """How many codes have a map with a singular value of 1 or more, and how many jittered instances run away."""
    away, room = {}, np.empty((2, POINTS))
    for jitter in (0.1, 0.4):
        fractals = Fractals(codes, jitter=jitter, flips=False, repeats=1)
        away[str(jitter)] = sum(kernels.draw(rows[:, :6] * factor, *choice(rows[:, 6]), np.uint64(0), kernels.POINTS,
                                             1.0, *room, np.zeros((16, 16), np.uint8)) < POINTS
                                for rows in fractals.rows for factor in factors(jitter))
    found = {"codes": len(codes), "stretch": sum(bool((code.singular_values() >= 1).any()) for code in codes),
             "instances": fractals.pictures, "run_away_by_jitter": away}
    print(f"{found['stretch']} of {found['codes']} codes have a map that stretches; instances that run away, by "
          f"jitter: {away} of {found['instances']}", flush=True)
    return found


def milliseconds(work: Callable[[int], object], count: int) -> float:
    """Processor time of a call, after one that compiles."""
    work(0)
    started = time.process_time()
    for index in range(count):
        work(index)
    return 1000 * (time.process_time() - started) / count


def by_pillow(image: np.ndarray, **options: int) -> bytes:
    """The PNG as Pillow writes it."""
    file = io.BytesIO()
    Image.fromarray(image).save(file, "PNG", **options)
    return file.getvalue()


def parts(codes: Sequence[IFS]) -> list[dict[str, Any]]:
    """Processor time of the parts of a picture, by kind and size."""
    rows = []
    for kind in KINDS:
        for size in (256, 362):
            fractals = Fractals(codes, draw=kind, size=size, points=POINTS, jitter=0, repeats=5, flips=False)
            images = [fractals.picture(index) for index in range(fractals.pictures)]
            rows.append({"draw": kind, "size": size, "bytes": float(np.mean([len(of_dots(image)) for image in images])),
                         "drawing_ms": milliseconds(fractals.picture, len(images)),
                         "png_ms": milliseconds(lambda index, images=images: of_dots(images[index]), len(images)),
                         "pillow_ms": milliseconds(lambda index, images=images: by_pillow(images[index]), len(images)),
                         "pillow_fast_ms": milliseconds(lambda index, images=images: by_pillow(
                             images[index], compress_level=1, compress_type=zlib.Z_RLE), len(images))})
            print("{draw:<8} {size}²: drawing {drawing_ms:.2f} ms, PNG {png_ms:.2f} ms ({pillow_ms:.2f} ms by Pillow, "
                  "{pillow_fast_ms:.2f} ms at its fastest), {bytes:.0f} bytes".format(**rows[-1]), flush=True)
    return rows


def rates(codes: Sequence[IFS]) -> list[dict[str, Any]]:
    """Pictures of 256² a second, on all cores, by where they go."""
    def loaded(fractals: Fractals, place: str) -> None:
        for _ in DataLoader(fractals, batch_size=None, num_workers=threads.available()):
            pass

    ways: dict[str, Callable[[Fractals, str], object]] = {
        "a folder of PNG": lambda fractals, place: write(fractals, ["code"] * len(codes), place),
        "WebDataset shards": lambda fractals, place: write(fractals, ["code"] * len(codes), place, 500),
        "a DataLoader": loaded}
    rows = []
    for kind in ("points", "patches"):
        for way, work in ways.items():
            fractals = Fractals(codes, draw=kind, size=256, points=POINTS, repeats=PICTURES // (25 * len(codes)),
                                flips=False)
            with TemporaryDirectory() as place:
                began, wall = os.times(), time.perf_counter()
                work(fractals, place)
                wall, ended = time.perf_counter() - wall, os.times()
            used = sum(ended[:4]) - sum(began[:4])
            rows.append({"draw": kind, "to": way, "per_second": fractals.pictures / wall, "cores": used / wall,
                         "processor_ms": 1000 * used / fractals.pictures})
            print("{draw:<8} to {to}: {per_second:.0f} pictures a second with {cores:.2f} cores, {processor_ms:.2f} ms "
                  "of a core each".format(**rows[-1]), flush=True)
    return rows


def beside(checkout: Path, codes: Sequence[IFS]) -> list[dict[str, Any]]:
    """Processor seconds of four PNG of a drawing by both renderers, and how many pictures of theirs are ours to the
    last pixel if we are given their points."""
    path = checkout / "fractal_renderer" / "ifs_function.py"
    spec = importlib.util.spec_from_file_location("ifs_function", path)
    if spec is None or spec.loader is None or not path.exists():
        raise SystemExit(f"{path} is not there; give a checkout of FractalDB-Pretrained-ResNet-PyTorch")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    rows = []
    for kind in ("points", "patches"):
        ours, theirs, same = [], [], 0
        fractals = Fractals(codes[:BESIDE], draw=kind, points=POINTS, jitter=0, repeats=1)
        fractals.picture(0)
        with TemporaryDirectory() as place:
            folder = Path(place, "code")
            folder.mkdir()
            for number in range(BESIDE):
                started = time.process_time()
                for flip in range(4):
                    (folder / f"{flip}.png").write_bytes(of_dots(fractals.picture(4 * number + flip)))
                ours.append(time.process_time() - started)
                started = time.process_time()
                drawing = module.ifs_function(0.0, 0.0, place, "code", "00")
                for row in fractals.rows[number]:
                    drawing.set_param(*row)
                drawing.calculate(POINTS)
                paused = time.process_time()
                points = np.array([drawing.xs, drawing.ys])
                started += time.process_time() - paused
                size = fractals.options["size"], fractals.options["size"], kernels.MARGIN, kernels.MARGIN
                (drawing.draw_point if kind == "points" else drawing.draw_patch)(*size, "gray", 0)
                theirs.append(time.process_time() - started)
                if kind == "points":
                    image = np.zeros(size[:2], np.uint8)
                    kernels.mark(*points, np.uint64(0), kernels.POINTS, 1.0, image)
                    drawn = np.array(Image.open(folder / "code_00_count_0_flip0.png").convert("L"))
                    same += bool((image == drawn).all())
        rows.append({"draw": kind, "ours": ours, "theirs": theirs, "ratio": sum(theirs) / sum(ours),
                     "same": same if kind == "points" else None})
        print(f"{kind:<8} four PNG of a drawing: {sum(ours) / BESIDE:.4f} s, by FractalDB's renderer "
              f"{sum(theirs) / BESIDE:.2f} s, {rows[-1]['ratio']:.0f} times as long"
              + (f"; from the same points, {same} of {BESIDE} are equal" if kind == "points" else ""), flush=True)
    return rows


def main() -> None:
    """Measure, print, record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkout", type=Path, nargs="?", help="of FractalDB's program and codes")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    options = parser.parse_args()
    threads.use()
    every, load = codes_of(options.checkout), os.getloadavg()
    codes = every[:CODES]
    figures: dict[str, Any] = {"codes": "FractalDB-1k" if options.checkout else "random", "parts": parts(codes)}
    figures["suite_target_256_ms"] = milliseconds(lambda index: target(random_suite(3)[index % 3], 256), 3)
    print(f"a grey target of the suite at 256²: {figures['suite_target_256_ms']:.0f} ms")
    figures["rates"] = rates(codes)
    if options.checkout is None:
        print("FractalDB's own renderer was not measured: no checkout of it was named")
    else:
        figures["beside"], figures["stretching"] = beside(options.checkout, codes), stretching(every)
    figures |= {"load_before": load, "load_after": os.getloadavg()}
    if options.record:
        ratios = {f"{row['draw']}: processor time of FractalDB's renderer over ours": row["ratio"]
                  for row in figures.get("beside", ())}
        ratios["drawing of points at 256²: processor time of a grey target of the suite over it"] = (
            figures["suite_target_256_ms"] / figures["parts"][0]["drawing_ms"])
        record.append(options.record, "datasets", figures, ratios)


if __name__ == "__main__":
    main()
