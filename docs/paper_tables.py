"""The tables of the paper's studies, from the fits that `benchmarks.comparisons` keeps."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from .cells import Rows, frame, short

SHRUNK = 0.01  # |det| up to which a map counts as shrunk: that much is added to it for the map's probability
PARTS = 0.25, 0.5, 0.75, 1.0  # of the iterations


def function_count(folder: Path) -> tuple[list[str], Rows]:
    """A row for each number of maps: the scores of all seeds, and how many maps of each code shrank."""
    rows = []
    for row, fits in frame(folder).groupby("row", sort=False):
        f1 = [scores["f1"] for scores in fits["scores"]]
        shrunk = [int((np.abs(np.linalg.det(np.array(code["linear"]))) < SHRUNK).sum()) for code in fits["code"]]
        rows.append([str(row), short(float(np.mean(f1))), ", ".join(map(short, f1)), ", ".join(map(str, shrunk)),
                     f"{fits['seconds'].mean():.0f}"])
    return ["maps", "F1", "of each seed", f"shrunk maps (det below {short(SHRUNK, 2)}) of each seed", "seconds"], rows


def real(*folders: Path) -> tuple[list[str], Rows]:
    """A row for each fit of a picture: the number of maps, and the scores on the input."""
    all_of = pd.concat([frame(folder) for folder in folders])
    rows = [[fit["sample"], f"`{fit['row']}`", str(len(fit["code"]["linear"])), short(fit["scores"]["f1"]),
             short(fit["scores"]["iou"]), f"{fit['scores']['psnr']:.1f}", short(fit["scores"]["ssim"]),
             f"{fit['seconds']:.0f}"] for _, fits in all_of.groupby("sample", sort=False)
            for fit in fits.to_dict("records")]
    return ["picture", "method", "maps", "F1", "IoU", "PSNR", "SSIM", "seconds"], rows


def convergence(folder: Path) -> tuple[list[str], Rows]:
    """A row for each variant: mean F1 of the best code so far, on the whole view, after parts of the iterations, and
    that of the result on all views."""
    fits, rows = frame(folder), []
    last = max(step for course in fits["course"] for _, _, step in course)
    for row, of_row in fits.groupby("row", sort=False):
        courses = [pd.DataFrame(course, columns=["seconds", "f1", "step"]) for course in of_row["course"]]
        reached = [np.mean([course.loc[course["step"] <= part * last, "f1"].iloc[-1] for course in courses])
                   for part in PARTS]
        rows.append([f"`{row}`", *(short(float(f1)) for f1 in reached),
                     short(float(np.mean([scores["f1"] for scores in of_row["scores"]]))),
                     f"{of_row['seconds'].mean():.0f}"])
    return ["row", *(f"{part * last:.0f} iterations" for part in PARTS), "all views", "seconds"], rows
