"""Dimensions of codes and of their drawings, beside the known values.

    python -m benchmarks.dimensions          prints the table; two minutes of a core
    python -m benchmarks.dimensions --record benchmarks/results/dimensions.jsonl

A row a set: what `code.dimension()` says, boxes counted on drawings of 256² and 1024², and, where the measure has a
formula, what points say in its place.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from tqdm import tqdm

from fractal_exp import IFS, codes, render
from fractal_exp.dimension.samples import MEASURES, count_boxes, lacunarity, of_points
from fractal_exp.ifs import attractor
from fractal_exp.runtime import threads

from . import record

SIDES = 256, 1024
GOLDEN = (1 + math.sqrt(5)) / 2
CORNERS = [[0, 0], [1, 0], [0, 1], [1, 1]]


def in_corners(width: list[float], height: list[float]) -> IFS:
    """Copies without rotation, of such sizes, the first in the lower left corner of the unit square, and so on."""
    size = torch.tensor([width, height]).T
    return IFS(torch.diag_embed(size), torch.tensor(CORNERS[:len(width)]) * (1 - size))


def bedford_mcmullen() -> IFS:
    """McMullen's first example: three of the six boxes of two rows and three columns."""
    at = torch.tensor([[0.0, 0], [1, 1], [2, 0]])
    size = torch.tensor([1 / 3, 1 / 2])
    return IFS(torch.diag(size).expand(3, 2, 2), at * size)


# The box dimension of each set where it is known, and what is no classic of this package.
KNOWN: dict[str, float | None] = {
    "line": 1, "cantor_dust": math.log(4, 3), "koch_curve": math.log(4, 3), "vicsek": math.log(5, 3),
    "sierpinski_triangle": math.log2(3), "three halves and a quarter": math.log2((3 + math.sqrt(13)) / 2),
    "hexaflake": math.log(7, 3), "pentaflake": math.log(6, GOLDEN**2), "sierpinski_carpet": math.log(8, 3),
    "filled square": 2, "heighway_dragon": 2, "twindragon": 2, "gosper_island": 2, "levy_c_curve": 2, "rauzy": 2,
    "product of Cantor sets": math.log(2, 3) + math.log(2, 4), "McMullen's carpet": 1 + math.log(3 / 2, 3),
    "fern": None, "tree": None, "maple_leaf": None,
}
OTHERS = {"line": in_corners([.5] * 2, [.5] * 2), "filled square": in_corners([.5] * 4, [.5] * 4),
          "three halves and a quarter": in_corners([.5] * 3 + [.25], [.5] * 3 + [.25]),
          "product of Cantor sets": in_corners([1 / 3] * 4, [1 / 4] * 4), "McMullen's carpet": bedford_mcmullen()}


def measured(name: str) -> dict[str, Any]:
    """All numbers of a set, and the milliseconds of the first."""
    code = OTHERS[name] if name in OTHERS else codes.known(name)
    start = time.process_time()
    found = code.dimension()
    took = 1000 * (time.process_time() - start)
    drawings = {side: render(attractor.normalize(code), resolution=side, supersample=1).numpy() > 0 for side in SIDES}
    measure = {kind: [asdict(each) for each in (code.dimension(kind), of_points(code, kind, 0))] for kind in MEASURES}
    return {"set": name, "known": KNOWN[name], "code": asdict(found), "milliseconds": took, **measure,
            "boxes": {side: asdict(count_boxes(lit)) for side, lit in drawings.items()},
            "lacunarity": lacunarity(drawings[SIDES[-1]])}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path, metavar="FILE", help="add the figures to a file of JSON lines")
    args = parser.parse_args()
    threads.use(1)
    codes.known("fern").dimension()  # compiles
    rows = [measured(name) for name in tqdm(KNOWN, "measuring", unit="set")]
    inside, of = 0, 0
    for row in rows:
        counts = [f"{each['value']:.2f} [{each['low']:.2f}, {each['high']:.2f}]" for each in row["boxes"].values()]
        print(f"{row['set']:28} known {row['known'] or math.nan:.5f}  {row['code']['kind']} {row['code']['value']:.5f} "
              f"{row['code']['standing']:12} boxes {'  '.join(counts)}  {row['milliseconds']:.0f} ms")
        if row["known"]:
            held = [each["low"] <= row["known"] <= each["high"] for each in row["boxes"].values()]
            inside, of = inside + sum(held), of + len(held)
    print(f"the interval of boxes holds the known value in {inside} of {of} drawings")
    if args.record:
        record.append(args.record, "dimensions", {"sets": rows}, {"boxes that hold the known value": inside / of})


if __name__ == "__main__":
    main()
