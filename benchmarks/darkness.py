"""What the paper's objective says of the truth, of the recorded fits at the paper's size, and of plain images.

    python -m benchmarks.darkness --record benchmarks/results/darkness.jsonl    minutes on two cores

The first four fractals of the suite at 1024², 480 000 points, without LPIPS and without the regulariser: the squared
error over mip levels with its weight plus D-SSIM. The levels are summed as written, stretched as released, or averaged
as by `loss=full`; averaged also with maps played by their area and the target matched to the splats
(`model.probabilities=area method.match_target=true`).
"""

from __future__ import annotations

import argparse
from pathlib import Path

import torch

from fractal_exp import IFS
from fractal_exp.methods.chaotic.losses import DSSIM, MipMSE, WeightedSum
from fractal_exp.methods.chaotic.model import SVD, ForwardModel
from fractal_exp.methods.chaotic.rendering import Rendering
from fractal_exp.runtime import threads
from fractal_exp.targets import SuiteFractal

from . import record

SIDE, SEED = 1024, 0
H200, H100 = record.RESULTS / "gpu_h200", record.RESULTS / "gpu_h100"
FITS = {0: {"fit": H200 / "fit_of_the_papers_method" / "code.json",
            "fit, matched": H100 / "fit_with_match_target" / "code.json"},
        **{index: {"fit": H200 / "fits_of_the_papers_method" / f"{index}.json"} for index in (1, 2, 3)}}
WAYS = {  # the term of mip levels and its weight, probabilities of the maps, and whether the target is matched
    "summed, as written": (MipMSE(summed=True), 10, "uniform", False),
    "stretched": (MipMSE(stretch=True), 100 / 9, "uniform", False),  # the released mean is over nine of ten levels
    "averaged": (MipMSE(), 10, "uniform", False),
    "by area": (MipMSE(), 10, "area", True)}


@torch.no_grad()
def objectives(index: int) -> dict[str, dict[str, float]]:
    """Of every candidate in every way, of one fractal."""
    target = SuiteFractal(index).load(SIDE)
    codes = {"truth": target.truth, **{name: IFS.load(path) for name, path in FITS[index].items()}}
    found: dict[str, dict[str, float]] = {}
    for way, (levels, weight, probabilities, matched) in WAYS.items():
        model = ForwardModel(SVD(), resolution=SIDE, probabilities=probabilities)
        image = model.match(target.image, SEED) if matched else target.image
        objective = WeightedSum({"mse": weight, "ssim": 1}, {"mse": levels, "ssim": DSSIM()}).prepare(image)
        drawn = {"black": torch.zeros_like(image), "white": torch.ones_like(image),
                 **{name: model(model.encode(code), SEED).image for name, code in codes.items() if code}}
        nothing = torch.zeros(1, 2)
        found[way] = {name: round(float(objective(Rendering(each, nothing, nothing, nothing))[0]), 3)
                      for name, each in drawn.items()}
        print(index, way, found[way], flush=True)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--record", type=Path, metavar="FILE", help="add a line of JSON to this file")
    args = parser.parse_args()
    threads.use()
    figures = {str(index): objectives(index) for index in FITS}
    if args.record:
        record.append(args.record, "darkness", figures, {})


if __name__ == "__main__":
    main()
