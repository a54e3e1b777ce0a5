"""Photographs of plants, as so many small maps: how like the picture a code's drawing is inside the shape.

    python -m benchmarks.photographs                    the pictures for tuning
    python -m benchmarks.photographs --role reporting   others, on which nothing was chosen
    python -m benchmarks.photographs --maps 0           as many maps as `invert` takes without being told
    python -m benchmarks.photographs --maps 128 --colour    with the pictures' colours, and how far off they are
    python -m benchmarks.photographs --maps 128 --sheet sheet.png    with a sheet of pictures and drawings, to look at
    python -m benchmarks.photographs --record benchmarks/results/photographs.jsonl

The pictures are those of Debian's package tuxpaint-stamps-default (GPL-2). They are read from where it is installed.
SSIM is that of `fractal_exp.evaluation.inside`, PSNR that of the whole picture; both of `Inversion.redrawn`. Seconds
are of one core, and include the judgement.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image
from skimage.transform import resize
from torch.nn.functional import adaptive_avg_pool2d
from tqdm import tqdm

from fractal_exp import invert
from fractal_exp.evaluation import metrics
from fractal_exp.evaluation.inside import ssim_inside
from fractal_exp.evaluation.summary import bootstrap_interval
from fractal_exp.images.painted import Painted
from fractal_exp.inversion.result import Inversion
from fractal_exp.runtime import threads

from . import record

PLANTS = Path("/usr/share/tuxpaint/stamps/plants")
TUNING = ("trees/birch", "trees/liberia-palm", "trees/holm_oak", "trees/pinecone", "trees/holly_leaves", "flowers/iris")
MAPS = 32, 64, 128, 256
FIGURES = "ssim", "psnr", "seconds", "colour_error", "colour_psnr"


def pictures(role: str, count: int, plants: Path = PLANTS) -> list[Path]:
    """Those for tuning, or as many others, evenly spread over the names of all flowers, mushrooms and trees. Raises
    SystemExit if the package is not installed."""
    paths = sorted(plants.glob("*/*.png"))
    if not paths:
        raise SystemExit(f"no pictures in {plants}; install the Debian package tuxpaint-stamps-default")
    tuning = [plants / f"{name}.png" for name in TUNING]
    if role == "tuning":
        return tuning[:count]
    others = [path for path in paths if path not in tuning]
    return others[::max(1, len(others) // count)][:count]


def fit(path: Path, maps: int, **options: Any) -> tuple[Inversion, dict[str, Any]]:
    """A code of so many maps, or of as many as `invert` takes if `maps` is 0, and its scores. options: of `invert`."""
    start = time.process_time()
    found = invert(path, maps=maps or None, **options)
    seconds = time.process_time() - start
    drawn, image = found.redrawn(), found.target.image
    colours = {} if found.code.colours is None else {
        "colour_error": found.likeness.colour, "colour_psnr": colour_psnr(found)}
    return found, {"picture": f"{path.parent.name}/{path.stem}", "maps": maps, "found": len(found.code),
                   "ssim": ssim_inside(drawn, image),
                   "psnr": float(metrics.psnr(drawn.clamp(0, 1)[None], image[None])), "seconds": seconds,
                   "verdict": found.verdict.words, **colours}


def colour_psnr(found: Inversion) -> float:
    """PSNR of the code drawn in its colours, against the picture in the target's square."""
    seen = torch.from_numpy(Painted.of(found.target).seen).movedim(-1, 0)
    shrunk = adaptive_avg_pool2d(seen, len(found.target.image))
    error = (found.redrawn(colour=True).clamp(0, 1).movedim(-1, 0) - shrunk).square().mean()
    return float(-10 * error.log10())


def table(lines: list[dict[str, Any]]) -> dict[str, dict[str, list[float]]]:
    """By number of maps and figure: the mean, and the ends of its 95% bootstrap interval."""
    return {str(maps): {name: [float(np.mean(values)), *map(float, bootstrap_interval(np.array(values)))]
                        for name in FIGURES
                        if (values := [line[name] for line in lines if line["maps"] == maps and name in line])}
            for maps in sorted({line["maps"] for line in lines})}


def sheet(rows: list[list[np.ndarray]]) -> Image.Image:
    """Pictures in [0,1] in rows, each as large as the last one."""
    rows = [[np.asarray(resize(each, row[-1].shape, anti_aliasing=True)) for each in row] for row in rows]
    return Image.fromarray(np.rint(255 * np.clip(np.vstack([np.hstack(row) for row in rows]), 0, 1)).astype(np.uint8))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--role", choices=("tuning", "reporting"), default="tuning")
    parser.add_argument("--count", type=int, default=12, help="at most so many pictures")
    parser.add_argument("--maps", type=int, nargs="+", default=MAPS)
    parser.add_argument("--colour", action="store_true", help="find the pictures' colours too")
    parser.add_argument("--sheet", type=Path, help="a PNG: a row a picture, with its drawings beside it")
    parser.add_argument("--record", type=Path, help="add the figures to this file")
    args = parser.parse_args()
    threads.use(1)
    lines, rows = [], []
    for path in tqdm(pictures(args.role, args.count), "fitting", unit="picture"):
        found = [fit(path, maps, colour=args.colour) for maps in args.maps]
        lines += [line for _, line in found]
        target = found[0][0].target
        rows.append([Painted.of(target).seen if args.colour else target.image.numpy(),
                     *(each.redrawn(colour=args.colour).numpy() for each, _ in found)])
    for line in lines:
        print(f"{line['picture']:32s} {line['maps']:4d} maps  SSIM {line['ssim']:.2f}  PSNR {line['psnr']:.1f}  "
              f"{line['seconds']:.1f} s  {line['verdict']}")
    means = table(lines)
    for maps, row in means.items():
        print(f"{maps:>4s} maps  " + "  ".join(f"{name} {value:.3g} [{low:.3g}, {high:.3g}]"
                                               for name, (value, low, high) in row.items()))
    if args.sheet:
        sheet(rows).save(args.sheet)
    if args.record:
        made = {"role": args.role, "colour": args.colour, "means": means, "fits": lines}
        record.append(args.record, "photographs", made,
                      {f"ssim {maps} maps": row["ssim"][0] for maps, row in means.items()})


if __name__ == "__main__":
    main()
