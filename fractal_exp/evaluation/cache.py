"""Renderings kept in a folder: every method is judged on the same images, so they are drawn once."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from dataclasses import dataclass
from pathlib import Path
from tempfile import NamedTemporaryFile

import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..ifs import IFS, View
from .render import render_with_info

log = logging.getLogger(__name__)

SAMPLER_VERSION = 1  # to be raised when the renderer draws other points from a seed


@dataclass(frozen=True)
class ImageCache:
    """Occupancy images by what determines them, as the counts of lit parts: exact, and small. None keeps nothing.

    They are drawn on `device`; those of a GPU hold other points, and are kept apart.
    """

    folder: str | Path | None
    device: str = "cpu"

    def render(self, code: IFS, view: View, *, resolution: int, points_in_view: int, supersample: int, seed: int
               ) -> Tensor:
        """The image of `render`, read from the folder if it is there. Raises `InputError` if it cannot be written."""
        size = {"resolution": resolution, "points_in_view": points_in_view, "supersample": supersample, "seed": seed}
        if self.folder is None:
            return _draw(code, view, size, self.device)
        path = Path(self.folder).absolute() / f"{_key(code, view, size, self.device)}.npz"
        scale = 1.0 / supersample**2
        if path.exists():
            with np.load(path, allow_pickle=False) as file:
                return torch.from_numpy((file["lit"] * scale).astype(np.float32))
        image = _draw(code, view, size, self.device)
        _write(path, (image.numpy() / scale).round().astype(np.uint16))
        return image


def _draw(code: IFS, view: View, size: dict[str, int], device: str) -> Tensor:
    """`render`, silent about views that hold nothing: among random views there are always some."""
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


def _write(path: Path, lit: np.ndarray) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Another process may be drawing the same image: each writes its own file, the last to finish wins.
        with NamedTemporaryFile(dir=path.parent, suffix=".partial", delete=False) as file:
            np.savez_compressed(file, lit=lit)
        os.replace(file.name, path)
    except OSError as error:
        raise InputError(f"cannot write to the image cache {path.parent}: {error.strerror}; choose another folder, or "
                         "none") from error
