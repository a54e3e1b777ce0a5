"""Verdicts on codes that are right, nearly right or wrong, beside the word of a person who looked at the drawings.

    python -m benchmarks.verdicts                   a quarter of an hour of two cores; needs matplotlib
    python -m benchmarks.verdicts --only seen       the pairs that a person looked at
    python -m benchmarks.verdicts --record benchmarks/results/verdicts.jsonl

Three groups of pairs of a picture and a code. *seen*: a person wrote "recovered", "approximation" or "not recovered"
beside the picture and the code's drawing. *right*: codes of recorded fits that are the true ones, or the truth itself,
on pictures of the random suite, textbook figures, trees and tone curves, and the classics plotted as dots. *wrong*:
made of every few of these by leaving out a map, moving one by a tenth of the figure's size, or taking a filled box or a
paving of the outline instead, and for dots by sharing them out otherwise. Where the package with Tux Paint's stamps is
installed, photographs of plants are paved too.
"""

from __future__ import annotations

import argparse
import random
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image, ImageDraw
from torch.nn.functional import interpolate
from tqdm import tqdm

from fractal_exp import codes, suite
from fractal_exp.cameras.estimate import angle_of, nearest
from fractal_exp.cameras.kinds import beside, kind_of, levels_of
from fractal_exp.cameras.params import CameraParams
from fractal_exp.cameras.points import counted
from fractal_exp.cameras.strokes import flat_maps
from fractal_exp.evaluation.inside import outline
from fractal_exp.ifs import attractor
from fractal_exp.ifs.code import IFS
from fractal_exp.images.levels import DRAWN, meaning_of
from fractal_exp.images.reading import ReadImage, read_target
from fractal_exp.likeness import Likeness, camera_for
from fractal_exp.runtime import threads
from fractal_exp.verdict import Verdict

from . import archive, record
from .pictures import fitting
from .pictures.paving import paving

RESULTS = Path(__file__).parent / "results"
PLANTS = Path("/usr/share/tuxpaint/stamps/plants")
SIDE, SIZE = 256, 1.5           # of a picture, pixels; of a figure on the canvas
MOVED, SLAB, PAVED = 0.1, 12, 64   # share of the figure's size; maps of a slab, of which few look like no accident
PLOT = "plot/"                  # begins the names of classics plotted as dots
DOTS, PLOT_SIDE = 60_000, 362   # of a plot: dots of one pixel, and its side before it is shrunk
OTHER_SHARES = 1.5              # power of the shares of maps in a plot whose dots are shared out otherwise
EVERY = 3                       # right codes of drawn pictures, of which one is spoilt; of others, all are
SOURCES = {"pictures_binary": ("binary", 1), "pictures_textbook": ("textbook", 3), "pictures_tone_curves":
           ("tone_curves", 3), "pictures_trees": ("trees", 3)}   # folder: set, and of how many fits one is taken
# What a person says of recorded codes that are not the true ones, and of some that are.
SEEN = {
    "textbook/levy-4-orange": "recovered", "textbook/pythagoras-4-green": "approximation",
    "textbook/pythagoras-8-blue": "approximation", "textbook/pythagoras-13-red": "approximation",
    "textbook/pythagoras-13-red-jpeg": "approximation", "textbook/pythagoras-13-orange": "approximation",
    "textbook/cyclosorus_dots-green": "approximation", "textbook/cyclosorus_dots-green-jpeg": "approximation",
    "textbook/maple_leaf_dots-red": "recovered", "textbook/culcita_dots-orange-jpeg": "recovered",
    "textbook/culcita_dots-orange": "approximation", "textbook/levy-8-black": "recovered",
    "textbook/cantor_set-3-black": "recovered", "textbook/binary_tree-12-white": "recovered",
    "tone_curves/fern-logarithm": "approximation", "tone_curves/fern-gamma": "recovered",
    "tone_curves/maple_leaf-flame": "approximation", "tone_curves/suite-1-tuning-flame": "approximation",
    "tone_curves/suite-2-tuning-gamma": "recovered", "tone_curves/suite-4-tuning-logarithm": "recovered",
    "tone_curves/suite-0-reporting-gamma": "not recovered", "tone_curves/suite-3-reporting-flame": "approximation",
    "tone_curves/suite-2-reporting-logarithm": "approximation", "trees/plant_4": "approximation",
}


@dataclass(frozen=True)
class Pair:
    """A picture and a code. person: the verdict of one who looked at both, or what is known of the code."""

    group: str
    name: str
    target: ReadImage
    code: IFS
    person: str


def seen() -> Iterator[Pair]:
    """The pairs that a person looked at."""
    for folder in ("textbook", "tone_curves", "trees"):
        for line in fitting.read(RESULTS / f"pictures_{folder}"):
            if word := SEEN.get(name := f"{folder}/{line['picture']}"):
                yield Pair("seen", name, fitting.target_of(folder, line), fitting.code_of(line), word)
    for depth in (3, 5, 7):
        target = read_target(t_square(depth), SIDE)
        yield Pair("seen", f"T-square of depth {depth}/filled square", target, box(target), "not recovered")
    for ratio in (0.48, 0.49):
        code = corners(ratio)
        for kind in ("grey", "binary"):
            image = suite.target(code, SIDE, kind)
            target = ReadImage.of_drawing(image, meaning_of(image))
            for what, each, word in (("true", code, "recovered"), ("filled square", box(target), "not recovered")):
                yield Pair("seen", f"crosses of {1 - 2 * ratio:.2f}, {kind}/{what}", target, each, word)
    for name in ("trees/birch", "trees/liberia-palm", "trees/holm_oak", "trees/pinecone", "trees/holly_leaves",
                 "flowers/iris"):
        if (path := PLANTS / f"{name}.png").exists():
            target = read_target(path, SIDE)
            slab = paving(outline(target.image.numpy() > 0.25), PAVED)
            yield Pair("seen", f"{name}/slab", target, slab, "approximation")


def right() -> Iterator[Pair]:
    """Codes that are the true ones."""
    for fit in archive.read(RESULTS / "collage_20261122_grey")[:40]:
        code = attractor.normalize(fit.truth)
        image = suite.target(code, SIDE, "grey")
        yield Pair("right", f"grey/suite-{fit.fractal}", ReadImage.of_drawing(image, meaning_of(image)), code, "true")
    for folder, (kind, every) in SOURCES.items():
        lines = [line for line in fitting.read(RESULTS / folder) if line.get("recovered") or line.get("exact")]
        for line in lines[::every]:
            yield Pair("right", f"{kind}/{line['picture']}", fitting.target_of(kind, line), fitting.code_of(line),
                       "true")
    for number, name in enumerate(codes.names()):
        code = attractor.normalize(codes.known(name))
        dots = (counted(code, PLOT_SIDE, DOTS, number) > 0).float()
        image = interpolate(dots[None, None], size=(SIDE, SIDE), mode="area")[0, 0]
        yield Pair("right", f"{PLOT}{name}", ReadImage.of_drawing(image, meaning_of(image)), code, "true")


def wrong(pair: Pair, rng: random.Random) -> Iterator[Pair]:
    """A right code, spoilt in several ways."""
    code, image = pair.code, pair.target.image
    spoilt = partial(Pair, "wrong", target=pair.target, person="wrong")
    if len(code) > 1:
        gone = rng.randrange(len(code))
        keep = [k for k in range(len(code)) if k != gone]
        chances = None if code.probabilities is None else code.probabilities[keep] / code.probabilities[keep].sum()
        yield spoilt(name=f"{pair.name}/a map left out", code=IFS(code.linear[keep], code.offset[keep], chances))
    angle, offset = rng.random() * 2 * np.pi, code.offset.clone()
    offset[rng.randrange(len(code))] += MOVED * SIZE * torch.tensor([np.cos(angle), np.sin(angle)]).to(offset)
    yield spoilt(name=f"{pair.name}/a map moved", code=replace(code, offset=offset))
    if pair.name.startswith(PLOT):
        shares = code.sampling_probabilities()**OTHER_SHARES
        yield spoilt(name=f"{pair.name}/other shares", code=replace(code, probabilities=shares / shares.sum()))
    yield spoilt(name=f"{pair.name}/box", code=box(pair.target))
    yield spoilt(name=f"{pair.name}/slab", code=paving(outline((image > 0.25 * image.max()).numpy()), SLAB))


def corners(ratio: float) -> IFS:
    """Four squares in the corners of a square: a ratio below a half leaves out crosses at every scale."""
    at = torch.cartesian_prod(torch.tensor([-1.0, 1.0]), torch.tensor([-1.0, 1.0]))
    return IFS(ratio * torch.eye(2).repeat(4, 1, 1), SIZE / 2 * (1 - ratio) * at)


def box(target: ReadImage) -> IFS:
    """The filled bounding box of a picture's shape."""
    rows, columns = np.nonzero(target.image.numpy() > 0.1 * float(target.image.max()))
    low, high = (np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()]) + 1)
    middle, half = (low + high) / SIDE - 1, (high - low) / SIDE
    code = corners(0.5)
    at = code.offset / code.offset.abs().max() * torch.from_numpy(half) / 2 + torch.from_numpy(middle * [1, -1]) / 2
    return IFS(code.linear, at.float())


def t_square(depth: int) -> np.ndarray:
    """Squares with squares of half the side around their corners, (2 SIDE, 2 SIDE) white on black."""
    image = Image.new("L", (2 * SIDE, 2 * SIDE))
    pen = ImageDraw.Draw(image)

    def draw(x: float, y: float, half: float, depth: int) -> None:
        pen.rectangle([round(x - half), round(y - half), round(x + half) - 1, round(y + half) - 1], fill=255)
        for side in ((-1, -1), (-1, 1), (1, -1), (1, 1)) if depth else ():
            draw(x + side[0] * half, y + side[1] * half, half / 2, depth - 1)

    draw(SIDE, SIDE, 0.375 * SIDE, depth)
    return np.asarray(image)


def measured(pair: Pair) -> dict[str, Any]:
    """The verdict on a pair and its figures, by the camera that suits the code best; flat maps may draw strokes."""
    target, levels = pair.target, levels_of(pair.target.image, pair.target.levels, CameraParams())
    camera = camera_for(pair.code, target)
    if not levels.is_exact and flat_maps(pair.code).any():
        kinds = [kind_of(name)(levels.params, target.image, kinds=levels.kinds)
                 for name in (camera.kind, *beside(camera.kind))]
        tried = [nearest(target.image, kind, pair.code, 0)[:1] for kind in kinds]
        others = [each for found in tried[1:] for each in found if tried[0] and each[0] < tried[0][0][0]]
        camera = min(others, key=angle_of)[1] if others else camera
    likeness = Likeness.of(pair.code, target, camera)
    verdict = Verdict.of(likeness, len(pair.code), target)
    figures = {name: None if value is None else round(value, 4) for name, value in asdict(likeness).items()}
    return {"group": pair.group, "pair": pair.name, "person": pair.person, "verdict": verdict.kind,
            "words": verdict.words, "maps": len(pair.code), "camera": camera.kind, **figures}


def pairs() -> Iterator[Pair]:
    """All pairs, in the same order and with the same random changes in every run."""
    yield from seen()
    for number, pair in enumerate(right()):
        yield pair
        if pair.target.levels != DRAWN or pair.name.startswith(PLOT) or number % EVERY == 0:
            yield from wrong(pair, random.Random(number))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=["seen", "right", "wrong"], help="one group of pairs")
    parser.add_argument("--record", type=Path, metavar="FILE", help="add the figures to a file of JSON lines")
    parser.add_argument("--workers", type=int, default=threads.available())
    args = parser.parse_args()
    chosen = [pair for pair in pairs() if args.only in (None, pair.group)]
    with ProcessPoolExecutor(args.workers, get_context("spawn"), torch.set_num_threads, (1,)) as pool:
        rows = list(tqdm(pool.map(measured, chosen), "judging", len(chosen), unit="pair"))
    for row in sorted(rows, key=lambda row: (row["group"], -row["ssim_share"])):
        if row["group"] == "seen" or (row["verdict"] == "recovered") != (row["group"] == "right"):
            dark = "    -" if row["f1_dark"] is None else f"{row['f1_dark']:5.2f}"
            print(f"{row['group']:5} {row['pair']:48} F1 {row['f1_1px']:.3f} SSIM {row['ssim']:5.2f} of "
                  f"{row['ssim_chance']:.2f} dark {dark} inside {row['ssim_share']:5.2f}  {row['person']}: "
                  f"{row['verdict']}")
    ratios = {}
    for group, bad in (("wrong", "recovered"), ("right", "approximation")):
        of = [row for row in rows if row["group"] == group]
        count = sum((row["verdict"] == "recovered") == (bad == "recovered") for row in of)
        print(f"{group}: {count} of {len(of)} {'called' if group == 'wrong' else 'not called'} recovered")
        ratios |= {f"{group}_misjudged": count / len(of)} if of else {}
    of = [row for row in rows if row["group"] == "seen"]
    agreed = sum((row["verdict"] == "recovered") == (row["person"] == "recovered") for row in of)
    print(f"seen: the person agrees on what is recovered in {agreed} of {len(of)}")
    if args.record:
        record.append(args.record, "verdicts", {"pairs": rows}, ratios | {"seen_agreed": agreed / max(len(of), 1)})


if __name__ == "__main__":
    main()
