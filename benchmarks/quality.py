"""How well the paper's method does on fractals of the random suite, beside the trivial images.

    python -m benchmarks.quality --count 10                  the first ten of the published suite, at laptop scale
    python -m benchmarks.quality --count 20 --seed 7         twenty of another suite, to tune on
    python -m benchmarks.quality --options '{"starts": 1}'   another setting of `methods.chaotic.laptop`
    python -m benchmarks.quality --options '{"perceptual": "fractal"}'   with a perceptual term
    python -m benchmarks.quality --init collage              begun with what collage search finds
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import pandas as pd
from tqdm import tqdm

from fractal_exp import suite, threads
from fractal_exp.evaluation import evaluate, score, summarize
from fractal_exp.evaluation.pictures import comparison_strip
from fractal_exp.evaluation.scoring import TRIVIAL
from fractal_exp.evaluation.summary import describe
from fractal_exp.images import write_image
from fractal_exp.methods import METHODS, load
from fractal_exp.methods.chaotic import laptop


def fit_one(index: int, seed: int, kind: str, options: dict, init: str | None, folder: Path) -> pd.DataFrame:
    """Fit one fractal; its rows, and those of the trivial images, one a view. Keeps the code and a picture."""
    threads.use(1)
    truth = suite.random_suite(index + 1, seed)[index]
    method = laptop(**options, init=load(init)(seed=options.get("seed", 0)) if init else None)
    resolution = method.model.resolution
    start = time.perf_counter()
    reconstruction = method.reconstruct(suite.target(truth, resolution, kind))
    seconds = time.perf_counter() - start
    scored = score(reconstruction, truth, resolution=resolution)
    reconstruction.code.save(folder / f"{seed}-{index:03d}.json")
    captions = [f"{row.view} (F1 {row.f1:.3f})" for row in scored.frame.itertuples()]
    write_image(folder / f"{seed}-{index:03d}.png", comparison_strip(scored.images, scored.truth, captions, side=200))
    frames = [scored.frame.assign(method="chaotic", seconds=seconds)]
    frames += [evaluate(image, truth, resolution=resolution).assign(method=name) for name, image in TRIVIAL.items()]
    return pd.concat(frames).assign(fractal=index, maps=len(truth))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--seed", type=int, default=suite.SUITE_SEED, help="of the suite (default: the published one)")
    parser.add_argument("--kind", choices=["grey", "binary"], default="grey")
    parser.add_argument("--options", type=json.loads, default={}, help="of methods.chaotic.laptop, as JSON")
    parser.add_argument("--init", choices=sorted(METHODS.keys() - {"chaotic"}), help="a method to begin with")
    parser.add_argument("--workers", type=int, default=threads.available())
    parser.add_argument("--output", type=Path, default=Path("outputs/quality"))
    args = parser.parse_args()
    args.output.mkdir(parents=True, exist_ok=True)
    frames = []
    with ProcessPoolExecutor(args.workers, get_context("spawn")) as pool:
        jobs = [pool.submit(fit_one, i, args.seed, args.kind, args.options, args.init, args.output)
                for i in range(args.count)]
        for job in tqdm(jobs):
            frames.append(job.result())
            pd.concat(frames).to_csv(args.output / "per_view.csv", index=False)
    table = pd.concat(frames)
    for name, rows in table.groupby("method", sort=False):
        print(f"\n{name}, {args.count} fractals, {args.kind} targets, mean and 95% interval")
        print(describe(summarize(rows.drop(columns=["seconds", "maps", "method"]))))
    fits = table[table["method"] == "chaotic"]
    print("\neach fractal: mean F1 over its views, on the whole view, seconds")
    for index, rows in fits.groupby("fractal"):
        whole = rows.loc[rows["view"] == "whole", "f1"].iloc[0]
        print(f"  {index:3d}  {rows['f1'].mean():.3f}  {whole:.3f}  {rows['seconds'].iloc[0]:5.0f}")


if __name__ == "__main__":
    main()
