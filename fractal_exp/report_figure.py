"""The figure of a sweep: rows of the table as rows of pictures, each sample whole and zoomed."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np
import torch

from . import tracking
from .evaluation.pictures import contact_sheet
from .report import Sweep

if TYPE_CHECKING:
    import pandas as pd

LARGEST = 24  # rows of pictures


def figure(uri: str, sweep: Sweep, *, samples: int = 2, side: int = 160) -> np.ndarray | None:
    """(H,W,3) uint8: the targets in the first row, then each row of the table, two pictures for each of the first
    `samples` samples. None if no job finished. The pictures come from the store."""
    jobs = sweep.jobs[sweep.jobs["status"] == "FINISHED"]
    if not len(jobs):
        return None
    rows = list(dict.fromkeys(jobs["row"]))[:LARGEST]
    chosen = list(dict.fromkeys(jobs["sample"]))[:samples]
    pictures, captions = [], []
    for sample in chosen:
        first = jobs[jobs["sample"] == sample].iloc[0]
        pictures += _pair(uri, first, "target", "zoomed_target")
        captions += [f"target, {sample}", "zoomed"]
    for row in rows:
        for sample in chosen:
            found = jobs[(jobs["row"] == row) & (jobs["sample"] == sample)]
            if len(found):
                pictures += _pair(uri, found.iloc[0], "result", "zoomed")
                captions += [row, f"F1 {found.iloc[0]['metric.f1']:.3f}"]
            else:
                pictures += [torch.zeros(8, 8)] * 2
                captions += [row, "no result"]
    return contact_sheet(pictures, captions, columns=2 * len(chosen), side=side)


def _pair(uri: str, job: pd.Series, *names: str) -> list[torch.Tensor]:
    from PIL import Image

    images = []
    for name in names:
        try:
            data = tracking.read_artifact(uri, job["run_id"], f"views/{name}.png")
        except Exception:  # a sweep over pictures has no zoomed views, and a lost file must not cost the figure
            images.append(torch.zeros(8, 8))
        else:
            images.append(torch.from_numpy(np.asarray(Image.open(io.BytesIO(data)).convert("L"), np.float32) / 255))
    return images
