"""The kinds of files that a film may be: MP4, WebM, GIF, and a sequence of PNG files."""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..images.pixels import png
from ..runtime.extras import need
from ..runtime.files import replacing, write_atomically

NUMBER = re.compile(r"%0?(\d*)d")  # where the number of a frame stands in a name, as ffmpeg has it
KEYS_EVERY = 250                   # frames from one whole picture to the next, at most: x264's own rule; VP9 has 128

MP4 = {"codec": "libx264", "quality": 8, "macro_block_size": 2}
WEBM = {"codec": "libvpx-vp9", "quality": None, "macro_block_size": 2,
        "output_params": ["-crf", "24", "-b:v", "0", "-deadline", "good", "-cpu-used", "4", "-row-mt", "1"]}


@dataclass(frozen=True)
class FilmFormat:
    """A kind of file that a film may be."""

    write: Callable[[Path, Iterable[np.ndarray], int, Mapping[str, Any]], None]
    """Writes pictures, uint8 (H,W) or (H,W,3), to a path, at so many frames a second."""
    fps: int = 30
    """Frames a second, unless told."""
    most_fps: int = 240
    """Frames a second, at most."""
    even: bool = False
    """Whether it needs an even number of pixels a side."""
    whole: Callable[[int], int] = lambda frames: 1
    """How many frames of so many are stored whole; the others are stored as changes."""
    exact: Callable[[int], float] = float
    """The frames a second that are shown where so many are asked for."""
    in_memory: bool = False
    """Whether all frames are in memory before they are written."""
    options: Mapping[str, Any] = field(default_factory=dict)


def _write_video(path: Path, pictures: Iterable[np.ndarray], fps: int, options: Mapping[str, Any]) -> None:
    """Write a film with ffmpeg, in a process of its own. The file appears when the last frame is written."""
    need("imageio_ffmpeg")
    import imageio_ffmpeg

    with replacing(path, f".partial{path.suffix}") as partial:
        film = None
        try:
            for picture in pictures:
                if film is None:
                    width_height, kind = picture.shape[1::-1], "gray" if picture.ndim == 2 else "rgb24"
                    film = imageio_ffmpeg.write_frames(partial, width_height, fps=fps, pix_fmt_in=kind,
                                                       pix_fmt_out="yuv420p", **options)
                    film.send(None)
                film.send(picture)
        except BaseException:
            # Closed after an error, it would pack all frames that ffmpeg still holds. This ends ffmpeg at once.
            with contextlib.suppress(KeyboardInterrupt):
                if film is not None:
                    film.throw(KeyboardInterrupt())
            raise
        if film is not None:
            film.close()


def _write_gif(path: Path, pictures: Iterable[np.ndarray], fps: int, options: Mapping[str, Any]) -> None:
    """Write a GIF, which appears when the last frame is written."""
    need("imageio")
    import imageio

    with (replacing(path, f".partial{path.suffix}") as partial,
          contextlib.closing(imageio.get_writer(partial, mode="I", duration=10 * _hundredths(fps), **options)) as film):
        writer: Any = film  # its declared type is the common base of readers and writers
        for picture in pictures:
            writer.append_data(picture)


def _write_sequence(path: Path, pictures: Iterable[np.ndarray], fps: int, options: Mapping[str, Any]) -> None:
    """Write a file for each frame, numbered from 1. Each appears when it is drawn."""
    for number, picture in enumerate(pictures, 1):
        write_atomically(frame_path(path, number), png(picture))


def frame_path(path: Path, number: int) -> Path:
    """The file of a frame in a sequence: %04d in the name becomes 0001 for the first."""
    return path.with_name(NUMBER.sub(lambda found: f"{number:0{int(found[1] or 1)}d}", path.name))


def _hundredths(fps: int) -> int:
    """How long a GIF shows a frame, in hundredths of a second, which is all that its format knows."""
    return max(2, round(100 / fps))


def _keys(frames: int) -> int:
    return math.ceil(frames / KEYS_EVERY)


BY_SUFFIX = {
    ".mp4": FilmFormat(_write_video, even=True, whole=_keys, options=MP4),
    ".webm": FilmFormat(_write_video, even=True, whole=_keys, options=WEBM),
    ".gif": FilmFormat(_write_gif, fps=25, most_fps=50, exact=lambda fps: 100 / _hundredths(fps), in_memory=True,
                       options={"loop": 0}),
}
SEQUENCE = FilmFormat(_write_sequence, whole=lambda frames: frames)
NAMES = f"{', '.join(BY_SUFFIX)}, or .png with %04d in the name for numbered pictures"


def is_film(path: str | Path) -> bool:
    """Whether a name is one of a film and not of a still."""
    path = Path(path)
    return path.suffix.lower() in BY_SUFFIX or (path.suffix.lower() == ".png" and bool(NUMBER.search(path.name)))


def format_of(path: str | Path) -> FilmFormat:
    """The kind of film that a name asks for. Raises `InputError` on another name."""
    path = Path(path)
    if not is_film(path):
        raise InputError(f"a film is {NAMES}; got {path.name!r}")
    if len(NUMBER.findall(path.name)) > 1:
        raise InputError(f"the number of a frame stands once in a name, got {path.name!r}; leave one %04d")
    if (number := NUMBER.search(path.name)) and len(number[1]) > 1:
        raise InputError(f"the number of a frame has at most 9 digits, got {path.name!r:.80}; write %04d")
    return BY_SUFFIX.get(path.suffix.lower(), SEQUENCE)
