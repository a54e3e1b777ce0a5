"""A shape in as many bytes as its code: the code itself, the picture made smaller and coded by JBIG, and its outlines.

    apt-get install jbigkit-bin                        for the encoder, pbmtojbg
    python -m benchmarks.pictures.equal_bytes          the kept codes of shapes and textbook fractals: five minutes

Of the textbook fractals, the deepest pictures are taken that are no JPEG. Six numbers of 16 bits are a map. JBIG (ITU-T
T.82) has no losses, so the picture is made as small as it must be to fit in, and enlarged again. Outlines are polygons
with a byte for each coordinate, packed by zlib where that is shorter; of many tolerances the best one counts, with the
largest polygons that fit in. Headers do not count. All three are judged by F1 within a pixel on the shape of 256².
Written: fits.jsonl, a line a picture, and report.md.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import time
import zlib
from bisect import bisect_right
from collections.abc import Mapping, Sequence
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
TOLERANCES = np.geomspace(0.25, 32, 30)   # of outlines, in pixels
SCORES = ("code", "jbig", "outlines")
TIED = 0.0005
SUMMARY_HEAD = ("| pictures | number | bytes | code | JBIG, made smaller | outlines | closest: code / JBIG / outlines, "
                "ties count for each | JBIG without loss | which is no more than the code |")
HEAD = "| picture | group | bytes | code | JBIG, made smaller | outlines | JBIG without loss |"


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


def packed(outlines: Sequence[np.ndarray]) -> tuple[bytes, bool]:
    """Polygons with corners (n,2) in [0, 255] as bytes, and whether zlib has packed them."""
    flat = [[*_count(len(each)), *each[0], *(np.diff(each, axis=0).ravel() % 256)] for each in outlines]
    plain = bytes(int(number) for each in flat for number in each)
    packer = zlib.compressobj(9, wbits=-15)  # without a header
    small = packer.compress(plain) + packer.flush()
    return (small, True) if len(small) < len(plain) else (plain, False)


def _count(corners: int) -> list[int]:
    """A number of corners in a byte, or in three from 255 on."""
    return [corners] if corners < 255 else [255, corners // 256, corners % 256]


def unpacked(data: bytes, by_zlib: bool) -> list[np.ndarray]:
    """The polygons that were packed."""
    numbers = np.frombuffer(zlib.decompress(data, wbits=-15) if by_zlib else data, np.uint8).astype(int)
    outlines, at = [], 0
    while at < len(numbers):
        corners, at = numbers[at], at + 1
        if corners == 255:
            corners, at = 256 * numbers[at] + numbers[at + 1], at + 2
        outlines.append(np.cumsum(numbers[at:at + 2 * corners].reshape(-1, 2), axis=0) % 256)
        at += 2 * corners
    return outlines


def outlined(mask: np.ndarray, most: int) -> np.ndarray:
    """The best of the masks (R,R) that are drawn from polygons in at most so many bytes."""
    edges = measure.find_contours(np.pad(mask, 1).astype(float), 0.5)
    edges = sorted(edges, key=_area, reverse=True)[:most]  # a polygon takes more than a byte
    drawn = [np.zeros_like(mask)]
    for tolerance in TOLERANCES:
        corners = (measure.approximate_polygon(edge, tolerance)[:-1] - 1 for edge in edges)  # the last is the first
        outlines = [np.rint(each).clip(0, len(mask) - 1) for each in corners if len(each) > 2]
        fits = bisect_right(range(1, len(outlines) + 1), most, key=lambda n: len(packed(outlines[:n])[0]))
        if fits:
            drawn.append(filled(unpacked(*packed(outlines[:fits])), mask.shape))
    return max(drawn, key=lambda each: judging.f1_within_a_pixel(each, mask))


def _area(corners: np.ndarray) -> float:
    """Of a closed polygon (n,2)."""
    (x, y), (u, v) = corners[:-1].T, corners[1:].T
    return abs(float((x * v - u * y).sum())) / 2


def filled(outlines: Sequence[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """The mask of pixels within an odd number of polygons."""
    mask = np.zeros(shape, bool)
    for each in outlines:
        rows, columns = draw.polygon(each[:, 0], each[:, 1], shape)
        mask[rows, columns] ^= True
    return mask


def group(line: Mapping[str, Any]) -> str:
    """The line of the summary that a picture belongs to."""
    if line["set"] == "shapes":
        return f"shapes, for {line['role']}"
    if line["recovered"] is None:
        return "textbook fractals without a code of a few maps"
    return f"textbook fractals, code {'recovered' if line['recovered'] else 'not recovered'}"


def compare(line: Mapping[str, Any]) -> dict[str, Any]:
    """The likeness of all three in as many bytes as the code of a kept fit has."""
    image = fitting.target_of(line["set"], line).image.numpy()
    shape, code = judging.shape_of(image), fitting.code_of(line)
    most = BYTES_OF_A_MAP * len(code)
    drawn = {"code": judging.drawing(rounded(code), len(shape)), "jbig": smaller(shape, most),
             "outlines": outlined(shape, most)}
    return {"picture": line["picture"], "group": group(line), "maps": len(code), "bytes": most,
            **{name: round(judging.f1_within_a_pixel(mask, shape), 4) for name, mask in drawn.items()},
            "lossless": jbig_bytes(shape), **archive.here(), "machine": machine(), "date": time.strftime("%Y-%m-%d")}


def chosen(lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """All shapes; of the textbook fractals, the deepest pictures that are no JPEG."""
    return [line for line in lines if line["set"] != "textbook" or (line["deepest"] and not line["jpeg"])]


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """The means of each group of pictures, and for how many each of the three is as close as any, to 0.0005."""
    best = rows[list(SCORES)].max(axis=1)
    closest = pd.DataFrame({f"{name} closest": rows[name] > best - TIED for name in SCORES})
    whole = pd.DataFrame({"without loss": rows["lossless"] <= rows["bytes"]})
    groups = pd.concat([rows, closest, whole], axis=1).groupby("group", sort=False)
    return groups[["bytes", *SCORES, "lossless"]].mean().join(groups[[*closest, *whole]].sum()).assign(
        pictures=groups.size()).reset_index()


def report(rows: pd.DataFrame) -> str:
    """As Markdown: the means of each group, then a row a picture."""
    about = (f"F1 within a pixel on 256². `python -m benchmarks.pictures.equal_bytes`, commit "
             f"{', '.join(sorted({str(each)[:9] for each in rows['commit']}))}, {rows['machine'].iloc[0]}.")
    lines = [about, "", SUMMARY_HEAD, "|" + "---|" * 9]
    for row in summary(rows).to_dict("records"):
        lines.append(f"| {row['group']} | {row['pictures']} | {row['bytes']:.0f} | {_scores(row)} | "
                     f"{' / '.join(str(row[f'{name} closest']) for name in SCORES)} | {row['lossless']:.0f} bytes | "
                     f"{row['without loss']} |")
    lines += ["", HEAD, "|" + "---|" * 7]
    lines += [f"| {row['picture']} | {row['group']} | {row['bytes']} | {_scores(row)} | {row['lossless']} bytes |"
              for row in rows.to_dict("records")]
    return "\n".join([*lines, ""])


def _scores(row: Mapping[str, Any]) -> str:
    return " | ".join(f"{row[name]:.3f}" for name in SCORES)


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
