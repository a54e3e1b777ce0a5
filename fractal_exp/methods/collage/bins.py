"""Measures on grids, from the masses of an image, and the correction of these masses where grey levels saturate.

Sums over images have double precision. torch shares a sum out among its threads, and in single precision its last
digits depend on their number. A whole search depends on these digits.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ... import ops
from ...cameras.levels import Levels
from ...cameras.points import WARMUP
from ...ifs.code import IFS
from ...ops.collage import BinnedMeasure
from ...ops.collage.reference import EDGE
from ...ops.counts import point_counts
from .params import SaturationParams

CELLS_PER_PIXEL = 1.3   # maximum along a side of the finest grid
PIXEL_PARTS = 2         # per side, into which a pixel is divided when its mass is shared among cells
# Of the correction for saturation.
TRUST = 4.0    # power of the agreement between image and rendering that gives the trust in a correction
LENGTH = 530   # points of each trajectory, including those of the warm-up
WEAK = 1e-3    # added to both masses of a pixel before their ratio is taken, because faint pixels tell little
WINDOW = 3     # pixels per side of the window over which all masses are averaged first


def grid_for(resolution: int, wanted: int) -> int:
    """Cells per side of a grid: the largest power of two that an image of this resolution fills, at most `wanted`."""
    return min(wanted, 2 ** (int(CELLS_PER_PIXEL * resolution).bit_length() - 1))


def binned(masses: Tensor, size: int, grids: int = BinnedMeasure.grids) -> BinnedMeasure:
    """The measure of an image's masses (R,R) on a grid of `size` cells per side. Its samples are the centroids of lit
    cells of the same grid, or the pixels if those are larger. grids: how many are compared."""
    resolution = masses.shape[0]
    masses = (masses / masses.sum(dtype=torch.float64)).float()
    row = torch.arange(resolution, device=masses.device)
    cells = min(size, resolution)
    cell = row * cells // resolution
    x = ((2 * row + 1) / resolution - 1).expand(resolution, -1)
    index = (cell[:, None] * cells + cell).flatten()
    weight, wx, wy = (torch.zeros(cells * cells, device=masses.device).scatter_add(0, index, values.flatten())
                      for values in (masses, masses * x, -masses * x.T))
    lit = weight > 0
    samples = torch.stack([wx[lit] / weight[lit], wy[lit] / weight[lit], weight[lit]], 1)
    shares = hats(resolution, size).to(masses.device)
    return BinnedMeasure(samples, shares.T @ masses @ shares, grids)


def hats(resolution: int, size: int) -> Tensor:
    """Shares (R,G) of each pixel's mass in the bilinear bins of one axis, with the mass in the middles of equal parts
    of the pixel."""
    shares = torch.zeros(resolution, size)
    row = torch.arange(resolution)
    for part in range(PIXEL_PARTS):
        u = ((row + (2 * part + 1) / (2 * PIXEL_PARTS)) * size / resolution - 0.5).clamp(0, size - EDGE)
        low = u.floor().long()
        shares[row, low] += (1 - (u - low)) / PIXEL_PARTS
        shares[row, low + 1] += (u - low) / PIXEL_PARTS
    return shares


def halve(bins: Tensor, size: int) -> Tensor:
    """Bins (…,G,G) summed to (…,size,size)."""
    step = bins.shape[-1] // size
    return avg_pool2d(bins.reshape(-1, 1, *bins.shape[-2:]), step).view(*bins.shape[:-2], size, size) * step**2


def saturation_corrected(masses: Tensor, code: IFS, levels: Levels, params: SaturationParams, seed: int) -> Tensor:
    """The masses (R,R) of an image times `correction`, summing to 1."""
    corrected = masses * correction(masses, code, levels, params, seed)
    return corrected / corrected.sum(dtype=torch.float64)


def correction(masses: Tensor, code: IFS, levels: Levels, params: SaturationParams, seed: int) -> Tensor:
    """Factors (R,R) that correct the masses of an image for saturation.

    Where the attractor is thinner than a subpixel, -log(1 - I) underestimates its measure, and the collage equation
    sum p_i f_i#mu = mu no longer holds for the estimate. The rendering of a code that is nearly right saturates in the
    same places. The ratio of the code's known measure to the estimate from its rendering, both averaged over a window,
    is applied to the image, but only as far as image and rendering agree: a wrong code must not spoil the masses.
    """
    if not params.enabled:
        return torch.ones_like(masses)
    resolution = masses.shape[0]
    points = ops.chaos_game(code.linear, code.offset, trajectories=params.trajectories, length=LENGTH, warmup=WARMUP,
                            probabilities=code.sampling_probabilities(), seed=seed)
    bins = point_counts(points, resolution).to(masses) / len(points)
    estimate = levels.measure(levels.render(code, resolution, seed).to(masses))
    if levels.known is not None:  # what lies off the canvas is not in the estimate
        bins = bins / bins.sum(dtype=torch.float64).clamp_min(1e-9)
    if not bool(estimate.any()):  # too thin for a binary image
        return torch.ones_like(masses)
    usual = 1 / estimate.sum(dtype=torch.float64)
    known, shown, seen = (avg_pool2d(image[None, None], WINDOW, 1, WINDOW // 2)[0, 0]
                          for image in (bins, estimate, masses))
    ratio = torch.where(shown > 1e-9, (known / usual + WEAK) / (shown + WEAK), 1)
    agreement = (torch.minimum(shown, seen) / torch.maximum(shown, seen).clamp_min(1e-9)) ** TRUST
    return ratio**agreement
