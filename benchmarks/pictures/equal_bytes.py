"""A shape in as many bytes as its code: the code itself, the picture made smaller and coded by JBIG, and its outlines.

    apt-get install jbigkit-bin                        for the encoder, pbmtojbg
    python -m benchmarks.pictures.equal_bytes          the kept codes of shapes and textbook fractals: two minutes

Of the textbook fractals, one picture a family is taken, the first of the deepest. Six numbers of 16 bits are a map.
JBIG (ITU-T T.82) has no losses, so the picture is made as small as it must be to fit in, and enlarged again. Outlines
are polygons with a byte for each coordinate, packed by zlib. Their tolerance is the least that fits in. Headers do not
count. All three are judged by F1 within a pixel on the shape of 256². Written: fits.jsonl, a line a shape, and
report.md.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import time
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
from PIL import Image
from skimage import draw, measure

from fractal_exp.ifs.code import IFS
from fractal_exp.methods.collage.params import BYTES_OF_A_MAP

from .. import archive
from ..record import RESULTS, machine
from . import fitting, judging

FOLDER = RESULTS / "pictures_equal_bytes"
FITS = {"shapes": RESULTS / "pictures_shapes", "textbook": RESULTS / "pictures_textbook"}
ENCODER = "pbmtojbg"
HEADER = 20                        # bytes, of JBIG
STEPS = 2**15                      # of a number of 16 bits, a side of zero
LARGEST = 2.0                      # offset that a code can have
TOLERANCES = np.geomspace(0.25, 32, 60)   # of outlines, in pixels
SCORES = ("code", "jbig", "outlines")
HEAD = "| picture | role | bytes | code | JBIG, made smaller | outlines | JBIG without loss |"


def rounded(code: IFS) -> IFS:
    """The code with six numbers of 16 bits a map; probabilities are tied to the determinants."""
    def step(values: torch.Tensor, largest: float) -> torch.Tensor:
        return (values / largest * STEPS).round().clamp(-STEPS, STEPS - 1) / STEPS * largest

    return IFS(step(code.linear.double(), 1.0), step(code.offset.double(), LARGEST)).check_contractive()


def jbig_bytes(mask: np.ndarray) -> int:
    """Bytes of a mask (h,w) as one stripe of JBIG, without the header."""
    height, width = mask.shape
    plain = f"P4\n{width} {height}\n".encode() + np.packbits(mask, axis=1).tobytes()
    made = subprocess.run([ENCODER, "-q", "-s", str(height)], input=plain, capture_output=True, check=True)
    return len(made.stdout) - HEADER


def resized(mask: np.ndarray, side: int) -> np.ndarray:
    """A mask on another number of pixels a side."""
    grey = Image.fromarray(mask.astype(np.uint8) * 255)
    return np.asarray(grey.resize((side, side), Image.Resampling.BICUBIC)) >= 128


def smaller(mask: np.ndarray, most: int) -> np.ndarray:
    """The mask (R,R) made smaller until JBIG codes it in at most so many bytes, and enlarged again."""
    for side in range(len(mask), 4, -2):
        small = resized(mask, side)
        if jbig_bytes(small) <= most:
            return resized(small, len(mask))
    return np.zeros_like(mask)


def packed(outlines: list[np.ndarray]) -> bytes:
    """Polygons with corners (n,2) in [0, 255]: of each its number of corners, the first, and the steps between them."""
    flat = [np.concatenate([[len(each) % 256], each[0], np.diff(each, axis=0).ravel() % 256]) for each in outlines]
    if not flat:
        return b""
    pack = zlib.compressobj(9, wbits=-15)  # without a header
    return pack.compress(np.concatenate(flat).astype(np.uint8).tobytes()) + pack.flush()


def outlined(mask: np.ndarray, most: int) -> np.ndarray:
    """The mask (R,R) drawn from polygons that fit into so many bytes, as close to its outlines as that allows."""
    edges = measure.find_contours(np.pad(mask, 1).astype(float), 0.5)
    for tolerance in TOLERANCES:
        rough = (np.rint(measure.approximate_polygon(edge, tolerance) - 1).clip(0, len(mask) - 1) for edge in edges)
        outlines = [each for each in rough if len(each) > 3]   # the first corner is also the last
        if len(packed(outlines)) <= most:
            return filled(outlines, mask.shape)
    return np.zeros_like(mask)


def filled(outlines: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """The mask of pixels within an odd number of polygons."""
    mask = np.zeros(shape, bool)
    for each in outlines:
        mask ^= draw.polygon2mask(shape, each)
    return mask


def compare(line: Mapping[str, Any]) -> dict[str, Any]:
    """The likeness of all three in as many bytes as the code of a kept fit has."""
    image = fitting.target_of(line["set"], line).image.numpy()
    shape, code = judging.shape_of(image), fitting.code_of(line)
    most = BYTES_OF_A_MAP * len(code)
    drawn = {"code": judging.drawing(rounded(code), len(shape)), "jbig": smaller(shape, most),
             "outlines": outlined(shape, most)}
    return {"set": line["set"], "picture": line["picture"], "role": line["role"], "maps": len(code), "bytes": most,
            **{name: round(judging.f1_within_a_pixel(mask, shape), 4) for name, mask in drawn.items()},
            "lossless": jbig_bytes(shape), **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}


def chosen(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All shapes; of the textbook fractals, the first of the deepest pictures of each family."""
    deepest: dict[str, dict[str, Any]] = {}
    for line in lines:
        if line.get("deepest"):
            deepest.setdefault(line["family"], line)
    return [line for line in lines if line["set"] != "textbook"] + list(deepest.values())


def report(rows: pd.DataFrame) -> str:
    """As Markdown: a table for each set, a row a picture, then the means."""
    lines = []
    for name, part in rows.groupby("set"):
        lines += [f"### {name}", "", HEAD, "|" + "---|" * HEAD.count(" | ") + "---|"]
        means = part.groupby("role", as_index=False)[["bytes", *SCORES, "lossless"]].mean().assign(picture="mean")
        for row in pd.concat([part, means]).to_dict("records"):
            scores = " | ".join(f"{row[score]:.3f}" for score in SCORES)
            lines.append(f"| {row['picture']} | {row['role']} | {row['bytes']:.0f} | {scores} "
                         f"| {row['lossless']:.0f} bytes |")
        best = part[list(SCORES)].idxmax(axis=1).value_counts()
        lines += ["", f"Closest: {', '.join(f'{score} {best.get(score, 0)}' for score in SCORES)}.", ""]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=FOLDER, help="where to write")
    folder = parser.parse_args().folder
    if shutil.which(ENCODER) is None:
        raise SystemExit(f"{ENCODER} is not installed; on Debian: apt-get install jbigkit-bin")
    rows = [compare(line) for fits in FITS.values()
            for line in chosen([line for line in fitting.read(fits) if "error" not in line])]
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "fits.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (folder / "report.md").write_text(text := report(pd.DataFrame(rows)))
    print(text)


if __name__ == "__main__":
    main()
