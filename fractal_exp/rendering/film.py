"""Films of codes: every frame is rendered at its own view."""

from __future__ import annotations

import math
import os
import shutil
import statistics
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numba
import numpy as np
import torch
from torch import Tensor

from ..errors import InputError
from ..ifs.code import IFS, View
from ..runtime.checks import check_count, check_memory, size_of
from ..runtime.deadline import in_words
from .colour import on_ground, own_ground
from .film_formats import NUMBER, SEQUENCE, format_of, frame_path
from .still import REUSE, RenderInfo, render_with_info
from .tone import tone_map, white_level, with_tone
from .toned import Toned

MEMORY = 0.9  # weight of the last frame's white level or exposure
AHEAD = 2     # frames in work at a time: what Python does for one takes no time from the kernels of the other
CLIPS, CLIP = 3, 4  # parts of a film that are drawn to foretell the rest, and frames of each
RARE = 16  # frames to a clip, at least: a short film is not foretold by drawing it twice


def frames(code: IFS | Sequence[IFS], views: Sequence[View], *, resolution: int | tuple[int, int] = 720,
           points_in_view: int | None = None, supersample: int = 8, mode: str = "occupancy",
           ground: tuple[float, float, float] | None = None) -> Iterator[Tensor]:
    """The picture in [0,1] of each view, (H,W), or (H,W,3) in colour on `ground` (default: the first code's own), one
    after another, with the arguments and errors of `render`.

    code: one for all views, or as many as there are views. The white level of a density and the exposure of a tone
    follow the scene slowly, so that the film does not flicker. A frame's points are used several times over, for speed;
    its pixels are no noisier. The same arguments give the same frames on any number of threads. Raises `InputError` at
    once on other numbers of codes.
    """
    codes = [code] * len(views) if isinstance(code, IFS) else list(code)
    if len(codes) != len(views):
        raise InputError(f"a film needs one code for all views or one for each, got {len(codes)} codes and "
                         f"{len(views)} views")

    tones = [Toned.of(code, mode) for code in codes]
    toned = [each for each in tones if each] if None not in tones else []
    if any(tones) and not toned:  # a film is of one kind
        codes = [with_tone(code, None) for code in codes]

    def draw(number: int, near: float) -> tuple[Tensor, RenderInfo]:
        return render_with_info(codes[number], views[number], resolution=resolution, points_in_view=points_in_view,
                                supersample=supersample, seed=number, mode=toned[number].mode if toned else mode,
                                reuse=REUSE, near=near)

    def drawn() -> Iterator[Tensor]:
        last = None
        for number, image in enumerate(_ahead(draw, len(codes))):
            if toned or mode == "density":
                image = toned[number].softened(image) if toned else image
                now = toned[number].exposure(image) if toned else white_level(image)
                last = now if last is None else last**MEMORY * now ** (1 - MEMORY)
                image = toned[number].shown(image, last) if toned else tone_map(image, last)
            if mode == "colour":
                image = on_ground(image, own_ground(codes[0]) if ground is None else ground)
            yield image
    return drawn()


def _ahead(draw: Callable[[int, float], tuple[Tensor, RenderInfo]], count: int) -> Iterator[Tensor]:
    """The images of so many frames in their order, `AHEAD` of them in work. Each is told the mass that was in view so
    many frames before."""
    mine = numba.get_num_threads()  # a number that each thread has for itself
    with ThreadPoolExecutor(AHEAD, initializer=numba.set_num_threads, initargs=(mine,)) as workers:
        working = deque(workers.submit(draw, number, 0.0) for number in range(min(AHEAD, count)))
        try:
            for number in range(count):
                image, info = working.popleft().result()
                if number + AHEAD < count:
                    working.append(workers.submit(draw, number + AHEAD, info.mass))
                yield image
        finally:
            workers.shutdown(cancel_futures=True)


def check_film(path: str | Path, resolution: int | tuple[int, int], fps: int, frames: int | None = None) -> Path:
    """The absolute path of a film. Raises `InputError` if it cannot be written, with so many frames if given."""
    height, width = size_of(resolution)
    path = Path(path).absolute()
    kind = format_of(path)
    if kind.even and (height % 2 or width % 2):
        raise InputError(f"a film needs an even number of pixels a side as {path.suffix}, got {width}×{height}")
    if not 1 <= fps <= kind.most_fps:
        raise InputError(f"a film has 1 to 240 frames a second, a GIF at most 50, got {fps}")
    if not os.access(path.parent, os.W_OK):
        raise InputError(f"cannot write to {path.parent}; choose a folder that exists and may be written")
    if frames is not None and kind is SEQUENCE:
        _check_sequence(path, frames)
    return path


def _check_sequence(path: Path, frames: int) -> None:
    """Raise `InputError` if the files of a sequence would not stand in their order, or among those of a longer one."""
    digits = len(str(frames))
    found = NUMBER.search(path.name)
    if found and int(found[1] or 1) < digits:
        raise InputError(f"{found[0]} has too few digits for {frames} frames; write %0{digits}d")
    if frame_path(path, frames + 1).exists():
        raise InputError(f"{frame_path(path, frames + 1)} is there, of a longer film than this one of {frames} frames; "
                         "delete that film, or choose another name")


def write_film(path: str | Path, pictures: Iterable[Tensor], *, fps: int | None = None) -> Path:
    """Write pictures, (H,W) grey or (H,W,3) colours in [0,1], as a film; return the absolute path.

    The name chooses the format: `.mp4` (H.264), `.webm` (VP9), `.gif` (repeats for ever), or `.png` with `%04d` where
    the number of a frame goes, from 1: `frames/fern-%04d.png`. A film of one file appears when its last frame is
    written, and numbered files one after another. fps: frames a second, 30 unless given, 25 for a GIF; a GIF shows each
    frame for whole hundredths of a second. Raises `InputError` on another name, a folder that cannot be written, more
    than 240 frames a second (a GIF: 50), no picture, and pictures of several shapes or of an odd side for MP4 and WebM.
    """
    kind = format_of(path)
    fps = kind.fps if fps is None else fps
    path = check_film(path, 2, fps)
    kind.write(path, _levels(path, pictures), fps, kind.options)
    return path


def _levels(path: Path, pictures: Iterable[Tensor]) -> Iterator[np.ndarray]:
    """Pictures as bytes, uint8. Raises `InputError` on the first that does not fit in with the others."""
    shape = None
    for picture in pictures:
        if shape is None:
            shape = tuple(picture.shape)
            if picture.ndim not in (2, 3) or shape[2:] not in ((), (3,)):
                raise InputError(f"a frame has shape (H,W) or (H,W,3), got {shape}")
            check_film(path, (shape[0], shape[1]), 1)
        if tuple(picture.shape) != shape:
            raise InputError(f"all frames of a film have one shape, got {shape} and then {tuple(picture.shape)}")
        yield (picture * 255).round().clamp(0, 255).to(torch.uint8).numpy()
    if shape is None:
        raise InputError("a film has at least one frame, got none")


@dataclass(frozen=True)
class Forecast:
    """What a film will be: its `frames`, the `seconds` that it plays, and estimates of its size in `bytes` and of the
    `drawing_seconds` on this machine as it is now."""

    frames: int
    seconds: float
    bytes: int
    drawing_seconds: float

    def __str__(self) -> str:
        return (f"{self.frames} frames, {self.seconds:.3g} s of film, about {_size(self.bytes)}, "
                f"{in_words(self.drawing_seconds)} to draw")


def forecast(path: str | Path, draw: Callable[[slice], Iterable[Tensor]], frames: int, *, fps: int | None = None
             ) -> Forecast:
    """Foretell a film from a few short clips of it, which are drawn and packed.

    draw: the pictures of a slice of the frames, such as `lambda part: film.frames(code, views[part])`. The size is
    usually right within a third, since clips tell nothing about what lies between them. Raises `InputError` as
    `check_film`, and if the disk or, for a GIF, the memory is too small for the film.
    """
    check_count("frames", frames)
    kind = format_of(path)
    fps = kind.fps if fps is None else fps
    path = check_film(path, 2, fps, frames)
    count, length = max(1, min(CLIPS, frames // RARE)), min(CLIP, frames)
    starts = [round((k + 0.5) / count * (frames - length)) for k in range(count)]
    clips = [_Clip.of(path, draw(slice(start, start + length)), fps) for start in starts]
    if kind.in_memory:
        check_memory(f"a {path.suffix[1:].upper()} of {frames} frames", frames * clips[0].pixels, torch.device("cpu"),
                     "draw fewer frames or pixels, or an .mp4")
    whole, change, drawing = (statistics.mean(getattr(clip, name) for clip in clips)
                              for name in ("whole", "change", "drawing"))
    stored_whole = min(frames, kind.whole(frames))
    size = round(stored_whole * whole + (frames - stored_whole) * change)
    free = shutil.disk_usage(path.parent).free
    if size > free:
        raise InputError(f"a film of {frames} frames would take about {_size(size)}, and {path.parent} has "
                         f"{_size(free)} left; draw fewer frames or pixels, or choose another disk")
    return Forecast(frames, frames / kind.exact(fps), size, frames * drawing)


@dataclass(frozen=True)
class _Clip:
    """What a few frames tell: bytes of one that is stored whole and of one that is stored as a change, seconds to draw
    and pack one, and the bytes of its pixels."""

    whole: float
    change: float
    drawing: float
    pixels: int

    @classmethod
    def of(cls, path: Path, pictures: Iterable[Tensor], fps: int) -> _Clip:
        drawn, took = [], []
        iterator = iter(pictures)
        while True:
            started = time.perf_counter()
            picture = next(iterator, None)
            if picture is None:
                break
            took.append(time.perf_counter() - started)
            drawn.append(picture)
        (one, packing_one), (several, packing_all) = (_packed(path, drawn[:count], fps) for count in (1, len(drawn)))
        others = max(1, len(drawn) - 1)
        change = (several - one) / others if len(drawn) > 1 else one
        # The median leaves out the compilation before the first frame.
        return cls(one, change, statistics.median(took) + max(0.0, packing_all - packing_one) / others,
                   drawn[0].numel())


def _packed(path: Path, pictures: Sequence[Tensor], fps: int) -> tuple[int, float]:
    """The bytes of a film of these pictures, and the seconds that it takes to write. It is written beside `path`, so
    that a disk that refuses it is the one that would refuse the film."""
    with TemporaryDirectory(prefix=".partial-", dir=path.parent) as folder:
        clip, started = Path(folder) / path.name, time.perf_counter()
        try:
            write_film(clip, pictures, fps=fps)
        except InputError as error:
            raise InputError(str(error).replace(str(clip), str(path))) from error
        took = time.perf_counter() - started
        return sum(file.stat().st_size for file in Path(folder).iterdir()), took


def _size(count: float) -> str:
    power = min(3, int(math.log10(max(count, 1)) / 3))
    return f"{count / 1000**power:.3g} {('B', 'kB', 'MB', 'GB')[power]}"
