"""Any view of an attractor, at any zoom."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from numbers import Integral

import numpy as np
import torch
from torch import Tensor

from .. import codes
from ..errors import InputError
from ..ifs.code import IFS, View
from ..ifs.contraction import AVERAGE
from ..ops import cuda_launch, histogram
from ..ops.histogram import Window
from ..ops.histogram.boxes import lit_share
from ..ops.histogram.cpu import COLOUR_UNIT, COLOURED, COUNTED, LIT
from ..runtime.checks import check_choice, check_count, check_memory, shown, size_of
from .toned import Toned
from .weighing import Plan, address_tree, weighed, window_of

log = logging.getLogger(__name__)

POINTS_AT_1024 = 50_000_000  # the paper's points per view at 1024²; other resolutions keep the points per pixel
MAX_ZOOM = 1e12              # above it, a pixel is no longer large compared with the rounding of a double
MAX_SUPERSAMPLE = 64
TILE = 8192                  # maximum supersampled pixels per side that are drawn at once
COLOUR_TILE = 1024           # maximum pixels per side that are drawn at once in colour
CHANNELS = {"colour": (4,), "tinted": (4,)}  # of a pixel, for modes whose pixels have several
UNDIVIDED = "density", "tinted"   # modes that need no subpixels
MODES = {"occupancy": LIT, "density": COUNTED, "colour": COLOURED, "tinted": COLOURED}

REUSE = 8                    # words under which a point of a film or a large picture is used, see `AddressTree`
MANY = 2 * POINTS_AT_1024    # points from which on a picture is large


@dataclass(frozen=True)
class RenderInfo:
    """What a rendering did: the points in the view, `requested` and `drawn` (a Poisson number; large ones agree within
    1%), the `mass` of the invariant measure in the view, and the `reason` if it holds fewer or no points."""

    requested: int
    drawn: int
    mass: float
    reason: str | None = None

    @property
    def empty(self) -> bool:
        """Whether no point of the attractor was found in the view."""
        return self.drawn == 0


@dataclass(frozen=True)
class Tile:
    """A piece of an image: `pixels` (T,U) or (T,U,4) float32, its upper left pixel at (`row`, `column`)."""

    row: int
    column: int
    pixels: np.ndarray
    drawn: int


def points_per_view(resolution: int | tuple[int, int]) -> int:
    """The paper's density of points at any resolution: 50 million at 1024², 3.1 million at 256²."""
    height, width = size_of(resolution)
    return max(1, round(POINTS_AT_1024 * (height / 1024 * (width / 1024))))


def render(code: IFS, view: View | None = None, *, resolution: int | tuple[int, int] = 1024,
           points_in_view: int | None = None, supersample: int = 8, seed: int = 0, mode: str = "occupancy",
           device: str = "cpu") -> Tensor:
    """Render a view of a code's attractor: an image (H,W), float32, on the CPU.

    - view: the window; the whole canvas by default.
    - resolution: (height, width) in pixels, or one number for both. 1/zoom is half of the picture's shorter side. So
      the view's square is seen whole, and a longer side shows more.
    - points_in_view: how many points of the chaos game land in the window, 50 million · H W / 1024² by default,
      however small the part of the attractor in the window.
    - supersample: subpixels per side of a pixel; unused where a density or a tone is drawn.
    - mode: "occupancy" gives the share, in [0,1], of the subpixels of a pixel that a point has hit. "density" gives the
      points in a pixel over their mean in the window, in [0, H W]: the density of the invariant measure
      relative to a uniform one. `tone.tone_map` makes an image of it. "tone", for a code that was found on a density,
      gives it the tone of that picture, in every view; see `tone.Tone`. "colour", for a code with colours, gives an
      image (H,W,4): the mean red, green and blue of the points in a pixel, and its opacity. The opacity is the
      "occupancy", or the cover if the code has a tone with one; see `toned.Toned`. `colour.on_ground` lays such an
      image on one colour. "tinted" has the "density" in the place of the opacity. A pixel without points is 0.
    - device: "cpu" or "cuda"; colours are drawn on the CPU alone. A GPU throws other points of the same
      distribution. The CPU always renders views in which points must be searched for.

    The same seed gives the same image on any number of threads. The image carries no gradient; the functions of
    `fractal_exp.ops` are differentiable. A view without points of the attractor is black. A view whose points would
    take too much work gets fewer. Both are logged as warnings, and `render_with_info` returns them as data.

    A code that contracts on average only (`IFS.contraction`) may have points anywhere. Its views leave out tails that
    hold less than about 3e-5 of the measure (see `ifs.attractor`). Where nothing else is in the view, points are thrown
    at the whole measure; how many is logged as a warning before the view is drawn.

    Raises `InputError` on anything but an IFS, a code that is not contractive, a zoom above 1e12, a size below 1 or too
    large for the memory, a device that cannot render, "colour" for a code without colours, or "tone" for one without.
    """
    image, info = render_with_info(code, view, resolution=resolution, points_in_view=points_in_view,
                                   supersample=supersample, seed=seed, mode=mode, device=device)
    if info.reason is not None:
        log.warning(info.reason)
    return image


def render_with_info(code: IFS, view: View | None = None, *, resolution: int | tuple[int, int] = 1024,
                     points_in_view: int | None = None, supersample: int = 8, seed: int = 0, mode: str = "occupancy",
                     device: str = "cpu", reuse: int = 1, effort: float = 1.0, near: float = 0.0
                     ) -> tuple[Tensor, RenderInfo]:
    """`render`, with a `RenderInfo` instead of warnings. reuse: as in `AddressTree`, for speed (CPU only). effort: the
    share, above 0, of the points that weigh the view, and of the work after which `render` gives up on its last points.
    near: the mass of a view much like this one, which makes weighing faster, or 0."""
    if toned := Toned.of(_drawable(code), mode):
        drawn, info = render_with_info(code, view, resolution=resolution, points_in_view=points_in_view, seed=seed,
                                       mode=toned.mode, device=device, reuse=reuse, effort=effort, near=near)
        return toned.drawn(drawn), info
    check_resolution(resolution)
    check_device(device, mode)
    code, view = _drawable(code), _checked(view)
    wanted = points_per_view(resolution) if points_in_view is None else points_in_view
    plan = _plan(code, view, resolution, wanted, supersample, seed, mode, reuse, effort, near)
    image, drawn = np.zeros((*size_of(resolution), *CHANNELS.get(mode, ())), np.float32), 0
    for tile in _tiles(plan, view, resolution, wanted, supersample, seed, mode, device):
        target = image[tile.row:tile.row + len(tile.pixels), tile.column:tile.column + tile.pixels.shape[1]]
        target[:] = tile.pixels[:target.shape[0], :target.shape[1]]
        drawn += tile.drawn
    return torch.from_numpy(image), RenderInfo(wanted, drawn, plan.mass, plan.reason)


def render_tiles(code: IFS, view: View | None = None, *, resolution: int | tuple[int, int],
                 points_in_view: int | None = None, supersample: int = 8, seed: int = 0, mode: str = "occupancy",
                 device: str = "cpu") -> Iterator[Tile]:
    """`render` in tiles of one size, row by row from the top, with memory that does not grow with the resolution.

    Tiles overhang the right and the lower edge. Arguments and errors are those of `render`, but a picture with a tone,
    which is exposed for a whole view, is refused. Each tile has its own points, all at the same density, so no seams
    show. From a hundred million points on, each is used several times.
    """
    check_device(device, mode)
    if toned := Toned.of(_drawable(code), mode):
        raise InputError(f'a tone is exposed for a whole view; draw tiles with mode="{toned.mode}", and see '
                         "fractal_exp.rendering.toned.Toned")
    code, view = _drawable(code), _checked(view)
    wanted = points_per_view(resolution) if points_in_view is None else points_in_view
    plan = _plan(code, view, resolution, wanted, supersample, seed, mode, REUSE if wanted >= MANY else 1)
    if plan.reason is not None:
        log.warning(plan.reason)
    return _tiles(plan, view, resolution, wanted, supersample, seed, mode, device)


def tile_side(length: int, supersample: int, mode: str = "occupancy") -> int:
    """The side, in pixels, of the tiles from `render_tiles` along a picture's side of this length: at most 8192
    supersampled pixels, in equal parts; at most 1024 pixels in colour, which takes 32 bytes a pixel and thread."""
    supersample = max(supersample, TILE // COLOUR_TILE) if MODES[mode] == COLOURED else supersample
    return math.ceil(length / math.ceil(length * supersample / TILE))


def _drawable(code: IFS) -> IFS:
    """The code without gradients. Raises `InputError`, with a hint how to get a code, on anything else."""
    if isinstance(code, str | os.PathLike):
        known = str(code) in codes.names()
        remedy = f"fractal_exp.codes.known({str(code)!r})" if known else f"IFS.load({str(code)!r})"
        raise InputError(f"a code must be an IFS, got {str(code)!r}; {remedy} reads it")
    if not isinstance(code, IFS):
        raise InputError(f"a code must be an IFS, got {type(code).__name__}; IFS(linear, offset) makes one")
    own = code.probabilities
    if not any(each.requires_grad for each in (code.linear, code.offset, own) if each is not None):
        return code
    return replace(code, linear=code.linear.detach(), offset=code.offset.detach(),
                   probabilities=None if own is None else own.detach())


def _checked(view: View | None) -> View:
    if view is not None and not isinstance(view, View):
        raise InputError(f"view must be a View, got {shown(view)}; View(center, zoom) makes one")
    return View() if view is None else view


def _plan(code: IFS, view: View, resolution: int | tuple[int, int], points: int, supersample: int, seed: int, mode: str,
          reuse: int = 1, effort: float = 1.0, near: float = 0.0) -> Plan:
    size_of(resolution)
    for name, value in (("points_in_view", points), ("reuse", reuse)):
        check_count(name, value)
    check_count("supersample", supersample, most=MAX_SUPERSAMPLE)
    if not isinstance(seed, Integral) or seed < 0:
        raise InputError(f"seed must be an integer of at least 0, got {seed!r}")
    check_choice("mode", mode, [*MODES, "tone"])
    if view.zoom > MAX_ZOOM:
        raise InputError(f"the zoom must be at most {MAX_ZOOM:g}, where double precision ends, got {view.zoom:g}")
    tree, window = address_tree(code, reuse, with_colours=MODES[mode] == COLOURED), window_of(view, resolution)
    return weighed(tree, window, points, seed, effort, near, has_tails=code.contraction.kind == AVERAGE)


def _tiles(plan: Plan, view: View, resolution: int | tuple[int, int], points: int, supersample: int, seed: int,
           mode: str, device: str) -> Iterator[Tile]:
    whole = window_of(view, resolution)
    height, width = (tile_side(length, supersample, mode) for length in (whole.height, whole.width))
    factor = 1 if mode in UNDIVIDED else supersample
    scatter = SCATTER[torch.device(device).type]
    for number, (row, column) in enumerate((r, c) for r in range(0, whole.height, height)
                                           for c in range(0, whole.width, width)):
        pixels, drawn = np.zeros((height, width, *CHANNELS.get(mode, ())), np.float32), 0
        if plan.thrown > 0:
            window = Window(whole.left + column / whole.scale, whole.top - row / whole.scale, whole.scale * factor,
                            width * factor, height * factor)
            pixels, drawn = scatter(plan, window, factor, (seed, 0, number), MODES[mode], device)
            per_mean = whole.height * whole.width / (plan.thrown * plan.mass)
            if mode == "density":
                pixels = (pixels * per_mean).astype(np.float32)
            elif mode in CHANNELS:
                opacity = pixels[..., 3] if mode == "colour" else pixels[..., 4] * per_mean
                pixels = np.dstack([pixels[..., :3], opacity.astype(np.float32)])
        yield Tile(row, column, pixels, drawn)


def _scatter_on_cpu(plan: Plan, window: Window, factor: int, seed: tuple[int, ...], mode: int, device: str
                    ) -> tuple[np.ndarray, int]:
    """The lit share of the factor² parts of each pixel for LIT, the number of its points for COUNTED, or its colour,
    lit share and number of points for COLOURED; and the number of points in the window."""
    canvas = histogram.planes(window.height, window.width, mode)
    size = window.height // factor, window.width // factor
    sums = histogram.colour_planes(*size) if mode == COLOURED else None
    drawn = plan.tree.scatter(window, plan.thrown, seed=seed, canvas=canvas, sums=sums, mode=mode).kept
    if mode == COUNTED:
        return canvas.sum(0), drawn
    pixels = np.empty(size, np.float32)
    lit_share(canvas, factor, pixels)
    if sums is None:
        return pixels, drawn
    whole = sums.sum(0)
    mean = whole[..., 1:] / (COLOUR_UNIT * np.maximum(whole[..., :1], 1))
    return np.dstack([mean.clip(0, 1).astype(np.float32), pixels, whole[..., 0].astype(np.float32)]), drawn


def _scatter_on_cuda(plan: Plan, window: Window, factor: int, seed: tuple[int, ...], mode: int, device: str
                     ) -> tuple[np.ndarray, int]:
    from ..ops.histogram import cuda as cuda_histogram

    done = cuda_histogram.scatter(plan.tree, window, plan.thrown, seed=seed, mode=mode, device=device,
                                  wanted=plan.thrown * plan.mass)
    if done is None:
        return _scatter_on_cpu(plan, window, factor, seed, mode, device)
    canvas, drawn = done
    image = canvas if mode == COUNTED else cuda_histogram.box_mean(canvas, factor)
    return image.cpu().numpy(), drawn


SCATTER = {"cpu": _scatter_on_cpu, "cuda": _scatter_on_cuda}


def check_device(device: str, mode: str = "occupancy") -> None:
    """Raise `InputError` unless images can be drawn on this device, in this mode."""
    try:
        kind = torch.device(device).type
    except RuntimeError:
        kind = None
    if kind not in SCATTER:
        raise InputError(f"images are drawn on {' or '.join(SCATTER)}, got device={device!r}")
    if kind == "cuda" and mode in CHANNELS:
        raise InputError(f"colours are drawn on the CPU, got device={device!r}; take device='cpu', or another mode "
                         "than 'colour'")
    if kind == "cuda" and not (torch.cuda.is_available() and cuda_launch.INSTALLED):
        raise InputError(f"device={device!r} needs an NVIDIA GPU with its driver, and numba-cuda (pip install "
                         "'fractal-exp[cuda]'); take device='cpu'")


def check_resolution(resolution: int | tuple[int, int], name: str = "resolution") -> None:
    """Raise `InputError` unless an image of this resolution can be drawn. The message calls the resolution `name`."""
    height, width = size_of(resolution, name)
    what = f"{height}²" if height == width else f"{width}×{height}"
    check_memory(f"an image of {what} pixels", 8 * height * width,  # the image and a copy
                 torch.device("cpu"), f"lower {name}, or draw it in tiles (render_tiles)")
