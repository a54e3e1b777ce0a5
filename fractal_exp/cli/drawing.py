"""What `fractal-render` does: stills, zoom films, morphs."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import numpy as np
import torch

from ..errors import InputError
from ..ifs.code import IFS, View
from ..rendering.colour import ground_of, on_ground, own_ground
from ..rendering.film import check_film, forecast, frames, write_film
from ..rendering.film_formats import NAMES, format_of, is_film
from ..rendering.morph import morph_path
from ..rendering.png import PngWriter
from ..rendering.still import CHANNELS, UNDIVIDED, render_tiles, render_with_info, tile_side
from ..rendering.tone import tone_map, usual_mode, white_level
from ..rendering.toned import COLOUR, Toned
from ..rendering.zoom import nearest_point, rich_point, zoom_path
from ..runtime import threads
from ..runtime.bars import progress_bar
from .code_names import read_code
from .commands import parse_size, refuse_idle

STILLS = {"bits": 8, "transparent": False}
OCCUPANCY = "occupancy"
FILMS = {"seconds": None, "fps": None}
ZOOMS = {"start_zoom": 1.0}
MORPHS = {"loop": False}
DEFAULTS = STILLS | ZOOMS | MORPHS | {"supersample": 8, "seed": 0}
SMALL = 512  # pixels of the longer side of the picture that finds a white level or an exposure
ZOOM_SECONDS, PASSAGE_SECONDS = 12.0, 4.0


def draw(options: argparse.Namespace) -> None:
    """Draw what the command line asks for."""
    threads.use()
    started = time.perf_counter()
    _refuse_unused(options)
    codes = [read_code(text, options.frame, options.order) for text in options.code]
    _choose_mode(codes, options)
    for name, value in DEFAULTS.items():
        if getattr(options, name) is None:
            setattr(options, name, value)
    if options.points is not None:
        if not (math.isfinite(options.points) and options.points >= 1):
            raise InputError(f"--points must be a number of at least 1, got {options.points}")
        options.points = int(options.points)
    path = draw_film(codes, options) if is_film(options.out) else draw_still(codes[0], options)
    print(f"{path} ({time.perf_counter() - started:.1f} s)")


def _choose_mode(codes: Sequence[IFS], options: argparse.Namespace) -> None:
    """Set the mode, if none is given, and the ground. Raises `InputError` on a background or parts of pixels that would
    change nothing, and on tones that no code has."""
    coloured, usual = all(code.colours is not None for code in codes), {usual_mode(code) for code in codes}
    options.mode = options.mode or (usual.pop() if len(usual) == 1 else OCCUPANCY)
    toned = all([Toned.of(code, options.mode) for code in codes])
    if options.supersample is not None and (toned or options.mode in UNDIVIDED):
        raise InputError(f"--supersample changes nothing with --mode {options.mode}"
                         + (" and a tone" if toned and options.mode == COLOUR else "") + "; leave it out"
                         + (f", or add --mode {OCCUPANCY}" if toned else ""))
    if options.background is not None and options.mode != COLOUR:
        raise InputError(f"--background changes nothing with --mode {options.mode}; leave it out"
                         + ("" if coloured else ", or find the code with fractal-invert --colour"))
    if options.background is not None and options.transparent:
        raise InputError("--background changes nothing with --transparent; leave one of them out")
    options.ground = own_ground(codes[0]) if options.background is None else ground_of(options.background)


def _refuse_unused(options: argparse.Namespace) -> None:
    """Raise `InputError` on an option that was given and would change nothing."""
    film, several = is_film(options.out), len(options.code) > 1
    if several and not film:
        raise InputError(f"{len(options.code)} codes make a film, which is {NAMES}; got {options.out!r}")
    if several and options.frame == "own":
        raise InputError("a morph frames every picture, and --frame own would leave the codes where they are; leave it "
                         "out")
    unused = {name: f"is for stills; {options.out} is a film" for name in STILLS} if film else {
        name: f"is for films; {options.out} is a still" for name in FILMS | ZOOMS | MORPHS}
    if several:
        unused |= {name: "is for a zoom into one code, not for a morph" for name in ("center", "zoom", "seed", *ZOOMS)}
    elif film:
        unused["loop"] = "returns to the first of several codes; a zoom into one code has no way back"
        if options.center:
            unused["seed"] = "chooses a film's target, which --center names"
    refuse_idle(options, unused)


def draw_still(code: IFS, options: argparse.Namespace) -> Path:
    """Draw one view, tile by tile."""
    size = parse_size(options.size, 1024)
    x, y = options.center or (0.0, 0.0)
    view = View((x, y), 1.0 if options.zoom is None else options.zoom)
    lit, empty = False, np.float32(options.ground if options.mode == COLOUR and not options.transparent else 0)
    with PngWriter(options.out, *reversed(size), bits=options.bits, transparent=options.transparent,
                   colour=options.mode == COLOUR) as file:
        for band in _bands(code, view, size, options):
            lit |= bool((band != empty).any())
            file.write(band)
    if not lit:
        x, y = nearest_point(code, view.center)
        print(f"fractal-render: the view is empty; the point of the attractor nearest to its centre is at "
              f"--center {x:.6g} {y:.6g}", file=sys.stderr)
    return file.path


def _bands(code: IFS, view: View, size: tuple[int, int], options: argparse.Namespace) -> Iterator[np.ndarray]:
    """The picture as bands of whole rows, each as high as a tile: density with a tone, colours on their ground."""
    toned = Toned.of(code, options.mode)
    mode = toned.mode if toned else options.mode
    rows = _rows(code, view, size, options, mode)
    if mode in UNDIVIDED:  # one white level or exposure for all tiles, from a small picture of the whole view
        shrunk = min(1.0, SMALL / max(size))
        height, width = (max(1, round(shrunk * side)) for side in size)
        small, _ = render_with_info(code, view, resolution=(height, width), mode=mode)
        if toned:
            exposure = toned.exposure(toned.softened(small))
            rows = (toned.shown(each, exposure) for each in softened_bands(rows, toned))
        else:
            white = white_level(small)
            rows = (tone_map(each, white) for each in rows)
    if options.mode == COLOUR and not options.transparent:
        rows = (on_ground(each, options.ground) for each in rows)
    return (each.numpy() for each in rows)


def _rows(code: IFS, view: View, size: tuple[int, int], options: argparse.Namespace, mode: str
          ) -> Iterator[torch.Tensor]:
    """What `render_tiles` draws in a mode, as bands of whole rows."""
    height, width = (tile_side(side, options.supersample, mode) for side in size)
    down, across = math.ceil(size[0] / height), math.ceil(size[1] / width)
    band = np.empty((height, across * width, *CHANNELS.get(mode, ())), np.float32)
    tiles = render_tiles(code, view, resolution=size, points_in_view=options.points, supersample=options.supersample,
                         seed=options.seed, mode=mode)
    for tile in progress_bar(tiles, desc="drawing", total=down * across, unit="tile", disable=down * across == 1):
        band[:, tile.column:tile.column + width] = tile.pixels
        if tile.column + width >= size[1]:
            yield torch.from_numpy(band[:size[0] - tile.row, :size[1]])


def softened_bands(bands: Iterable[torch.Tensor], toned: Toned) -> Iterator[torch.Tensor]:
    """Bands of rows, softened as the whole image would be: each with the rows beside it."""
    above = held = torch.empty(0, 0)
    for band in bands:
        if len(held):
            yield toned.softened(torch.cat([above, held, band[:1]]))[1:-1]
        above = held[-1:] if len(held) else torch.zeros_like(band[:1])
        held = band.clone()
    if len(held):
        yield toned.softened(torch.cat([above, held]))[1:]


def draw_film(codes: Sequence[IFS], options: argparse.Namespace) -> Path:
    """Draw a zoom into one code, or a morph through several, frame by frame."""
    size = parse_size(options.size, 720)
    kind = format_of(options.out)
    fps = kind.fps if options.fps is None else options.fps
    passages = len(codes) - (not options.loop)
    seconds = options.seconds if options.seconds is not None else (PASSAGE_SECONDS * passages or ZOOM_SECONDS)
    if not (math.isfinite(seconds) and seconds * fps >= 2):
        raise InputError(f"a film has at least 2 frames, got {seconds} s at {fps} frames a second")
    count = round(seconds * fps)
    path = check_film(options.out, size, fps, count)
    course, views = (morph_path(codes, count, loop=options.loop) if len(codes) > 1
                     else _zoom(codes[0], count, options))

    def drawn(part: slice) -> Iterator[torch.Tensor]:
        return frames(course[part], views[part], resolution=size, points_in_view=options.points,
                      supersample=options.supersample, mode=options.mode, ground=options.ground)

    print(forecast(path, drawn, count, fps=fps), flush=True)
    return write_film(path, progress_bar(drawn(slice(None)), desc="drawing", total=count, unit="frame"), fps=fps)


def _zoom(code: IFS, count: int, options: argparse.Namespace) -> tuple[Sequence[IFS], Sequence[View]]:
    """One code, and the views of a zoom into a point of its attractor."""
    start = View(zoom=options.start_zoom)
    end_zoom = 1e4 if options.zoom is None else View(zoom=options.zoom).zoom
    zoom_path((0.0, 0.0), count, start=start, end_zoom=end_zoom)  # what it refuses, before the target is looked for
    target = (nearest_point(code, tuple(options.center)) if options.center
              else rich_point(code, options.seed, end_zoom=end_zoom))
    print(f"zooming to ({target[0]!r}, {target[1]!r})")
    return [code] * count, zoom_path(target, count, start=start, end_zoom=end_zoom)
