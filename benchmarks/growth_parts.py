"""Where growth loses likeness: photographs of plants with other parts in the place of growth's own.

    python -m benchmarks.growth_parts --record benchmarks/results/growth_parts.jsonl

- "plain paving": cells by k-means, and no descent.
- "growth": as it is.
- "four times the steps": a longer descent.
- "linear tone": grey levels are proportional to mass, in the place of 1 - exp(-m).
- "its collage": growth's maps draw the picture's own masses once, in the place of their attractor. What is missing
  there is lost by the descent or for want of maps; the rest is lost between the collage and the attractor.
- "twice the maps": as many steps.

SSIM is that of `fractal_exp.evaluation.inside`, PSNR that of the whole picture. Seconds are of one core.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from torch import Tensor
from tqdm import tqdm

from fractal_exp.cameras.blur import blurred
from fractal_exp.cameras.points import counted
from fractal_exp.evaluation import metrics
from fractal_exp.evaluation.inside import ssim_inside
from fractal_exp.evaluation.summary import bootstrap_interval
from fractal_exp.images.reading import read_target
from fractal_exp.methods.collage.growth.descent import BLUR_PX, Found, descended
from fractal_exp.methods.collage.growth.exposed import Exposed
from fractal_exp.methods.collage.growth.paving import paving
from fractal_exp.methods.collage.params import CollageParams
from fractal_exp.ops.collage import pushforward
from fractal_exp.rendering.curve import Curve
from fractal_exp.runtime import threads

from . import record
from .photographs import pictures

MAPS = 32, 64, 128
POINTS = 8_000_000   # of a drawing
STEPS = CollageParams().growth.steps


def plain(target: Exposed, maps: int) -> Found:
    """A paving, whose drawing has the picture's mass."""
    return paving(target, maps), float(target.masses.sum())


def grown(target: Exposed, maps: int, steps: int = STEPS) -> Found:
    return descended(paving(target, maps), target, steps, 0)


def drawn(target: Exposed, found: Found) -> Tensor:
    """What the camera of grown maps shows of their attractor, (R,R)."""
    maps, mass = found
    return _shown(target, counted(maps.code, target.side, POINTS, 0) * (mass / POINTS))


def collage(target: Exposed, found: Found) -> Tensor:
    """What it shows of the picture's own masses under the maps, (R,R)."""
    maps, mass = found
    lit = target.masses > 0
    row, column = (each + 0.5 for each in lit.nonzero().unbind(1))
    x, y = 2 * column / target.side - 1, 1 - 2 * row / target.side
    samples = torch.stack([x, y, target.masses[lit] / target.masses.sum()], 1)
    return _shown(target, mass * pushforward(maps.maps[None], maps.probabilities[None], samples, target.side)[0])


def _shown(target: Exposed, masses: Tensor) -> Tensor:
    return target.curve.grey(blurred(masses, BLUR_PX)).clamp(0, 1)


PARTS: dict[str, tuple[Callable[[Exposed, int], Found], Callable[[Exposed, Found], Tensor]]] = {
    "plain paving": (plain, drawn), "growth": (grown, drawn),
    "four times the steps": (lambda target, maps: grown(target, maps, 4 * STEPS), drawn),
    "linear tone": (lambda target, maps: grown(replace(target, curve=Curve(linear=True)), maps),
                    lambda target, found: drawn(replace(target, curve=Curve(linear=True)), found)),
    "its collage": (grown, collage),
    "twice the maps": (lambda target, maps: grown(target, 2 * maps), drawn)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--role", choices=("tuning", "reporting"), default="tuning")
    parser.add_argument("--count", type=int, default=12, help="at most so many pictures")
    parser.add_argument("--maps", type=int, nargs="+", default=MAPS)
    parser.add_argument("--record", type=Path, help="add the figures to this file")
    args = parser.parse_args()
    threads.use(1)
    lines = []
    for path in tqdm(pictures(args.role, args.count), "growing", unit="picture"):
        target = Exposed(read_target(path, resolution=256).image)
        for maps in args.maps:
            done: dict[Callable, tuple[Found, float]] = {}
            for part, (grow, draw) in PARTS.items():
                if grow not in done:
                    start = time.process_time()
                    done[grow] = grow(target, maps), round(time.process_time() - start, 2)
                found, seconds = done[grow]
                shown = draw(target, found)
                lines.append({"picture": path.stem, "maps": maps, "part": part, "seconds": seconds,
                              "ssim": ssim_inside(shown, target.grey),
                              "psnr": float(metrics.psnr(shown[None], target.grey[None]))})
    means = {f"{part}, {maps} maps": {name: _mean([line[name] for line in lines
                                                   if (line["part"], line["maps"]) == (part, maps)])
                                      for name in ("ssim", "psnr", "seconds")}
             for maps in args.maps for part in PARTS}
    for name, row in means.items():
        print(f"{name:32s} SSIM {row['ssim'][0]:.3f} [{row['ssim'][1]:.3f}, {row['ssim'][2]:.3f}]  "
              f"PSNR {row['psnr'][0]:.1f}  {row['seconds'][0]:.1f} s")
    if args.record:
        record.append(args.record, "growth_parts", {"role": args.role, "means": means, "fits": lines},
                      {f"ssim {name}": row["ssim"][0] for name, row in means.items()})


def _mean(values: list[float]) -> list[float]:
    """The mean, and the ends of its 95% bootstrap interval."""
    return [float(np.mean(values)), *map(float, bootstrap_interval(np.array(values)))]


if __name__ == "__main__":
    main()
