"""Zooms as films. Every frame is rendered at its own view."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS, View
from ..runtime.extras import need
from ..runtime.files import replacing
from .colour import BLACK, on_ground
from .still import render_with_info, tone_map, white_level

SUFFIXES = (".mp4", ".gif")
MEMORY = 0.9  # weight of the last frame's white level in a density film


def frames(code: IFS, views: Sequence[View], *, resolution: int = 720, points_in_view: int | None = None,
           supersample: int = 8, mode: str = "occupancy", ground: tuple[float, float, float] = BLACK
           ) -> Iterator[Tensor]:
    """The picture in [0,1] of each view, (R,R), or (R,R,3) in colour on `ground`, one after another, with the arguments
    and errors of `render`.

    Density is tone mapped with a white level that follows the scene slowly, so that the film does not flicker.
    """
    white = None
    for number, view in enumerate(views):
        image, _ = render_with_info(code, view, resolution=resolution, points_in_view=points_in_view,
                                    supersample=supersample, seed=number, mode=mode)
        if mode == "density":
            now = white_level(image)
            white = now if white is None else white**MEMORY * now ** (1 - MEMORY)
            image = tone_map(image, white)
        elif mode == "colour":
            image = on_ground(image, ground)
        yield image


def check_film(path: str | Path, resolution: int, fps: int) -> Path:
    """The absolute path of a film. Raises `InputError` if it cannot be written."""
    path = Path(path).absolute()
    if path.suffix.lower() not in SUFFIXES:
        raise InputError(f"a film is an {' or '.join(SUFFIXES)} file, got {path.name!r}")
    if resolution % 2:
        raise InputError(f"a film needs an even number of pixels a side, got {resolution}")
    if not 1 <= fps <= (50 if path.suffix.lower() == ".gif" else 240):
        raise InputError(f"a film has 1 to 240 frames a second, a GIF at most 50, got {fps}")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"cannot write to {path.parent}; choose a folder that exists and may be written")
    return path


def write_film(path: str | Path, pictures: Iterable[Tensor], *, fps: int = 30) -> Path:
    """Write pictures (R,R) or (R,R,3) in [0,1] as an MP4 (H.264) or a GIF that repeats; return the absolute path.

    The file appears when the last frame is written. Raises `InputError` on another suffix or a folder that cannot be
    written.
    """
    need("imageio", "imageio_ffmpeg")
    import imageio

    path = check_film(path, 2, fps)
    options: dict[str, Any] = {"duration": 1000 / fps, "loop": 0}
    if path.suffix.lower() == ".mp4":
        options = {"fps": fps, "codec": "libx264", "quality": 8, "pixelformat": "yuv420p", "macro_block_size": 2}
    with (replacing(path, f".partial{path.suffix}") as partial,
          imageio.get_writer(partial, mode="I", **options) as film):
        writer: Any = film  # its declared type is the common base of readers and writers
        for picture in pictures:
            writer.append_data((picture * 255).round().to(torch.uint8).numpy())
    return path
