"""A folder cache of renderings: every method is judged on the same images, so they are drawn only once."""

from __future__ import annotations

import hashlib
import json
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS, View
from ..runtime.files import explain, replacing
from .still import render_with_info

log = logging.getLogger(__name__)

SAMPLER_VERSION = 1  # raise it when the renderer draws other points from the same seed


@dataclass(frozen=True)
class ImageCache:
    """Occupancy images, keyed by everything that determines them. They are stored as exact, small counts of lit parts.
    Without a folder (None), nothing is stored.

    Images are drawn on `device`. A GPU draws other points, so its images are stored separately.
    """

    folder: str | Path | None
    device: str = "cpu"

    def render(self, code: IFS, view: View, *, resolution: int, points_in_view: int, supersample: int, seed: int
               ) -> Tensor:
        """The image of `render`, from the folder if it is there. Raises `InputError` if it cannot be written."""
        size = {"resolution": resolution, "points_in_view": points_in_view, "supersample": supersample, "seed": seed}
        if self.folder is None:
            return _draw(code, view, size, self.device)
        path = Path(self.folder).absolute() / f"{_key(code, view, size, self.device)}.npz"
        scale = 1.0 / supersample**2
        lit = _read(path, resolution) if path.exists() else None
        if lit is not None:
            return torch.from_numpy((lit * scale).astype(np.float32))
        image = _draw(code, view, size, self.device)
        _write(path, (image.numpy() / scale).round().astype(np.uint16))
        return image


def _draw(code: IFS, view: View, size: dict[str, Any], device: str) -> Tensor:
    """`render` without warnings about empty views, because random views always include some."""
    image, info = render_with_info(code, view, **size, device=device)
    if info.reason is not None and not info.empty:
        log.warning(info.reason)
    return image


def _key(code: IFS, view: View, size: dict[str, int], device: str) -> str:
    digest = hashlib.sha256()
    for tensor in (code.linear, code.offset, code.sampling_probabilities()):
        digest.update(tensor.cpu().numpy().astype("<f4").tobytes())
    sampler = [] if device == "cpu" else [torch.device(device).type]
    digest.update(json.dumps([SAMPLER_VERSION, *view.center, view.zoom, size, *sampler], sort_keys=True).encode())
    return digest.hexdigest()[:32]


def _read(path: Path, resolution: int) -> np.ndarray | None:
    """The counts of lit parts (R,R). If the file is damaged, log a warning and return None, to draw the image again."""
    try:
        with np.load(path, allow_pickle=False) as arrays:
            lit = arrays["lit"]
        if lit.shape != (resolution, resolution) or lit.dtype != np.uint16:
            raise InputError(f"it holds {lit.dtype} {lit.shape}, expected uint16 {(resolution, resolution)}")
        return lit
    except Exception as error:  # on damaged files NumPy and zipfile raise almost anything
        log.warning("%s is damaged (%s) and is drawn again", path, error)
        return None


def _write(path: Path, lit: np.ndarray) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as partial, open(partial, "wb") as file:
            np.savez_compressed(file, lit=lit)
    except (OSError, InputError) as error:
        reason = error if isinstance(error, InputError) else f"cannot write {explain(error, path.parent)}"
        raise InputError(f"{reason}; or name no image cache") from error
