"""The paper's method and collage search on real pictures, in the same time: a retina's vessels and a snowflake glyph.

    python -m benchmarks.pictures samples                    one minute each
    python -m benchmarks.pictures samples --seconds 120
    python -m benchmarks.pictures samples --seconds 0 --methods collage --pictures retina --maps 64
    python -m benchmarks.pictures samples --seconds 0 --methods collage --pictures fern
                                                             the two fits of `make run`

Each is judged on its input: F1, IoU, PSNR and SSIM of the inner 75% at the input's resolution; and, drawn by the camera
that was found, F1 within a pixel and SSIM inside the shape. A line of JSON for each
fit is added to --record: its code and scores, the seconds that cores worked on it, after each stage as well, commit and
machine.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd
import torch

from fractal_exp import View
from fractal_exp.evaluation import metrics
from fractal_exp.images import samples
from fractal_exp.images.levels import TargetImage
from fractal_exp.images.pixels import write_image
from fractal_exp.likeness import Likeness
from fractal_exp.methods import METHODS, load
from fractal_exp.methods.base import Progress
from fractal_exp.rendering.sheets import comparison_strip
from fractal_exp.runtime import threads
from fractal_exp.targets import KnownCode

from .. import archive, record

PICTURES = {"retina": samples.retina_vessels, "snowflake": samples.snowflake,
            "fern": lambda resolution: KnownCode("fern").load(resolution).image}
REAL = "retina", "snowflake"


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="benchmarks.pictures samples", description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60, help="for each fit; 0: no limit")
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--pictures", choices=PICTURES, nargs="+", default=REAL)
    parser.add_argument("--methods", choices=METHODS, nargs="+", default=list(METHODS))
    parser.add_argument("--maps", type=int, help="how many the code gets (default: as the method finds them)")
    parser.add_argument("--threads", type=int, help="default: one a core")
    parser.add_argument("--record", type=Path, help="file of JSON lines to add to")
    parser.add_argument("--output", type=Path, default=Path("outputs/pictures"))
    args = parser.parse_args(arguments)
    rows, drawn, captions = [], [], []
    used = threads.use(args.threads)
    for name in args.pictures:
        image = PICTURES[name](args.resolution)
        for method in args.methods:
            for seed in args.seeds:
                start, work, stages = time.perf_counter(), time.process_time(), []
                asked = {} if args.maps is None else {"maps": args.maps}
                built = load(method)(resolution=args.resolution, seed=seed, seconds=args.seconds or None, **asked)
                found = built.reconstruct(image, on_step=_keeper(stages, work))
                seconds, work = time.perf_counter() - start, time.process_time() - work
                result = found.render(View(), resolution=args.resolution)
                scores = {k: float(v) for k, v in metrics.compare(result[None], image[None]).items()}
                likeness = Likeness.of(found.code, TargetImage.of(image), found.camera)
                rows.append({"picture": name, "method": method, "seed": seed, "maps": len(found.code), **scores,
                             "f1_1px": likeness.f1_1px, "ssim_inside": likeness.ssim,
                             "seconds": seconds, "core_seconds": work})
                if args.record:
                    figures = rows[-1] | {"limit": args.seconds or None, "threads": used, "stages": stages,
                                          "code": archive.plain(found.code)}
                    record.append(args.record, "pictures", figures, ratios(figures))
                print(pd.DataFrame(rows[-1:]).round(3).to_string(index=False, header=len(rows) == 1), flush=True)
                if seed == args.seeds[0]:
                    drawn.append((result, image))
                    captions.append(f"{name}, {method}, F1 {scores['f1']:.2f}")
    args.output.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(args.output / "pictures.csv", index=False)
    results, targets = (torch.stack(images) for images in zip(*drawn, strict=True))
    write_image(args.output / "pictures.png", comparison_strip(results, targets, captions))
    print(f"pictures: {args.output / 'pictures.png'}")


def ratios(figures: dict) -> dict[str, float]:
    """The fit's F1."""
    limit = f"{figures['limit']:g} s" if figures["limit"] else "no limit"
    return {f"{figures['picture']}, {figures['method']}, {limit}: F1": figures["f1"]}


def _keeper(stages: list[dict], start: float) -> Callable[[Progress], None]:
    """Puts down what each stage of collage search ends with, and the seconds that cores had worked by then."""
    def keep(progress: Progress) -> None:
        if progress.code is not None:
            stages.append({"stage": progress.stage, "maps": len(progress.code), "error": progress.scalars["error"],
                           "core_seconds": round(time.process_time() - start, 2)})
    return keep
