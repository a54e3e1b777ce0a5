"""Exported `.flame` files, drawn by flam3: whether shape and colours are those that `render` draws.

    python -m benchmarks.flame                         five minutes on a quiet core; needs flam3-render, scikit-image
    python -m benchmarks.flame --side 256 --limit 3    three codes of each kind, at 256²
    python -m benchmarks.flame --record benchmarks/results/formats.jsonl --sheet flame.png

Drawn are the classic codes, fractals of the suite of seed 2025, the codes with colours of the last record of
`benchmarks.colour`, and the same fractals of the suite with colours and blends at random. Each is written as a `.flame`
file and drawn by `flam3-render` and by `render`, in the file's camera.

F1 is that of the lit pixels. Beside it stands the F1 of two pictures by `render` with other random points: where rare
points make the shape, no two drawings agree. The colour difference is the mean CIEDE2000 between the mean colours of
the points in a pixel, over the pixels that both light. flam3's picture is taken with transparency, so that neither its
brightness nor a thin cover counts.
"""

from __future__ import annotations

import argparse
import os
import shutil
import statistics
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from skimage.color import deltaE_ciede2000, rgb2lab

from fractal_exp import IFS, Colours, codes, render
from fractal_exp.evaluation.metrics import f1
from fractal_exp.ifs.formats.flame import SIZE, camera_of
from fractal_exp.rendering.colour import on_ground
from fractal_exp.suite import SUITE_SEED, random_suite

from . import record

FRACTALS = 16        # of the suite
LEAST_BLEND = 0.1    # of colours at random
GOAL = 0.95          # F1
COLUMNS = 4          # pairs of pictures on a row of the sheet


def classics() -> Iterator[tuple[str, IFS]]:
    """The classic codes, which have no colours."""
    return ((name, codes.known(name)) for name in codes.names())


def fractals() -> Iterator[tuple[str, IFS]]:
    """Fractals of the suite, which have no colours."""
    return ((f"suite {index}", code) for index, code in enumerate(random_suite(FRACTALS, SUITE_SEED)))


def found_in_drawings() -> Iterator[tuple[str, IFS]]:
    """Codes with the colours that were found in coloured drawings."""
    drawings = record.read(record.RESULTS / "colour.jsonl")[-1]["figures"]["drawings"]
    return ((each["drawing"], IFS.from_json(each["code"])) for each in drawings)


def at_random() -> Iterator[tuple[str, IFS]]:
    """The same fractals with colours at random."""
    for number, (name, code) in enumerate(fractals()):
        random, maps = np.random.default_rng([SUITE_SEED, number]), len(code)
        colours = Colours(torch.from_numpy(random.uniform(0, 1, (maps, 3))),
                          torch.from_numpy(random.uniform(LEAST_BLEND, 1, maps)))
        yield name, replace(code, colours=colours)


KINDS = {"classic": classics, "suite": fractals, "found in drawings": found_in_drawings, "colours at random": at_random}


def by_flam3(code: IFS, side: int) -> np.ndarray:
    """flam3's picture of an exported code: (side,side,4) in [0,1], red, green, blue and opacity."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = code.save(Path(folder) / "code.flame"), Path(folder) / "code.png"
        settings = {"in": str(path), "out": str(out), "ss": str(side / SIZE), "transparency": "1",
                    "isaac_seed": "fractal", "nthreads": "1"}
        subprocess.run(["flam3-render"], check=True, capture_output=True, env=os.environ | settings)
        return np.asarray(Image.open(out), np.float32) / 255


def measured(name: str, code: IFS, side: int) -> tuple[dict[str, Any], list[np.ndarray]]:
    """The figures of one code; and flam3's picture and ours on black, (side,side,3)."""
    mode = "occupancy" if code.colours is None else "colour"
    flam3, own = by_flam3(code, side), render(code, camera_of(code), resolution=side, mode=mode).numpy()
    cover = own if code.colours is None else own[..., 3]
    again = render(code, camera_of(code), resolution=side, seed=1).numpy()
    figures: dict[str, Any] = {"code": name, "f1": agreement(flam3[..., 3], cover), "f1_again": agreement(again, cover)}
    shown = np.repeat(own[..., None], 3, -1) if code.colours is None else on_ground(torch.from_numpy(own)).numpy()
    if code.colours is not None:
        both = (flam3[..., 3] > 0) & (cover > 0)
        apart = deltaE_ciede2000(rgb2lab(flam3[both][:, :3]), rgb2lab(own[both][:, :3]))
        figures |= {"ciede2000": float(apart.mean()), "ciede2000_95": float(np.percentile(apart, 95))}
    colours = (f", CIEDE2000 {figures['ciede2000']:.2f}, {figures['ciede2000_95']:.1f} at 95% of pixels"
               if code.colours else "")
    print(f"  {name:20} F1 {figures['f1']:.3f}, of two of ours {figures['f1_again']:.3f}{colours}", flush=True)
    return figures, [flam3[..., :3] * flam3[..., 3:], shown]


def agreement(one: np.ndarray, other: np.ndarray) -> float:
    """F1 of the lit pixels of two pictures (side,side)."""
    return float(f1(*(torch.from_numpy(each.copy())[None] for each in (one, other))))


def sheet(pairs: list[list[np.ndarray]], path: Path) -> None:
    """Write pairs of pictures, flam3's on the left of each."""
    rows = [np.hstack([each for pair in pairs[k:k + COLUMNS] for each in pair]) for k in range(0, len(pairs), COLUMNS)]
    widest = max(row.shape[1] for row in rows)
    whole = np.vstack([np.pad(row, ((0, 0), (0, widest - row.shape[1]), (0, 0))) for row in rows])
    Image.fromarray(np.rint(255 * whole.clip(0, 1)).astype(np.uint8)).save(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=512, help="pixels a side of the pictures")
    parser.add_argument("--limit", type=int, help="codes of each kind (default: all)")
    parser.add_argument("--record", type=Path, help="file of records to add to")
    parser.add_argument("--sheet", type=Path, help="PNG to write: flam3's picture and ours of each code")
    options = parser.parse_args()
    if shutil.which("flam3-render") is None:
        parser.error("flam3-render is not installed; apt-get install flam3-utils")
    rows: dict[str, list[dict[str, Any]]] = {}
    pairs = []
    for kind, given in KINDS.items():
        print(kind)
        made = [measured(name, code, options.side) for name, code in islice(given(), options.limit)]
        rows[kind] = [figures for figures, _ in made]
        pairs += [pair for _, pair in made]
    scores = [row["f1"] for kind in ("classic", "suite") for row in rows[kind]]
    ratios = {"mean F1": statistics.mean(scores), "least F1": min(scores),
              f"share of codes with F1 ≥ {GOAL}": sum(score >= GOAL for score in scores) / len(scores)}
    ratios |= {f"CIEDE2000, {kind}": statistics.mean(row["ciede2000"] for row in rows[kind])
               for kind in ("found in drawings", "colours at random")}
    print(ratios)
    if options.sheet:
        sheet(pairs, options.sheet)
    if options.record:
        record.append(options.record, "flame", {"side": options.side, "codes": rows}, ratios)


if __name__ == "__main__":
    main()
