"""The paper's method and collage search on real pictures, in the same time: a retina's vessels and a snowflake glyph.

    python -m benchmarks.pictures                    one minute each
    python -m benchmarks.pictures --seconds 120

Each is judged on its input: F1, IoU, PSNR and SSIM of the inner 75% at the input's resolution.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import pandas as pd
import torch

from fractal_exp import View, samples
from fractal_exp.evaluation import metrics
from fractal_exp.evaluation.pictures import comparison_strip
from fractal_exp.images import write_image
from fractal_exp.methods import METHODS, load

PICTURES = {"retina": samples.retina_vessels, "snowflake": samples.snowflake}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--output", type=Path, default=Path("outputs/pictures"))
    args = parser.parse_args()
    rows, drawn, captions = [], [], []
    for name, source in PICTURES.items():
        image = source(args.resolution)
        for method in METHODS:
            for seed in args.seeds:
                start = time.perf_counter()
                built = load(method)(resolution=args.resolution, seed=seed, seconds=args.seconds)
                found = built.reconstruct(image)
                seconds = time.perf_counter() - start
                result = found.render(View(), resolution=args.resolution)
                scores = {k: float(v) for k, v in metrics.compare(result[None], image[None]).items()}
                rows.append({"picture": name, "method": method, "seed": seed, "maps": len(found.code), **scores,
                             "seconds": seconds})
                print(pd.DataFrame(rows[-1:]).round(3).to_string(index=False, header=len(rows) == 1), flush=True)
                if seed == args.seeds[0]:
                    drawn.append((result, image))
                    captions.append(f"{name}, {method}, F1 {scores['f1']:.2f}")
    args.output.mkdir(parents=True, exist_ok=True)
    pd.DataFrame(rows).to_csv(args.output / "pictures.csv", index=False)
    results, targets = (torch.stack(images) for images in zip(*drawn, strict=True))
    write_image(args.output / "pictures.png", comparison_strip(results, targets, captions))
    print(f"pictures: {args.output / 'pictures.png'}")


if __name__ == "__main__":
    main()
