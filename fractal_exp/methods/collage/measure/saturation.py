"""Correction of an image's measure for the saturation of its grey levels."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from .... import ops
from ....cameras.levels import Levels
from ....ifs.canvas import canvas_to_pixel
from ....ifs.code import IFS
from ..params.measure import SaturationParams

TRUST = 4.0    # power of the agreement between image and rendering that gives the trust in a correction
LENGTH = 530   # points of each trajectory, including those of the warm-up
WARMUP = 30    # points at the start of each trajectory that are dropped
WEAK = 1e-3    # added to both masses of a pixel before their ratio is taken, because faint pixels tell little
WINDOW = 3     # pixels per side of the window over which all masses are averaged first


def saturation_corrected(masses: Tensor, code: IFS, levels: Levels, params: SaturationParams, seed: int) -> Tensor:
    """The masses (R,R) of an image times `correction`, summing to 1."""
    corrected = masses * correction(masses, code, levels, params, seed)
    return corrected / corrected.sum()


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
    bins = torch.zeros_like(masses)
    points = ops.chaos_game(code.linear, code.offset, trajectories=params.trajectories, length=LENGTH, warmup=WARMUP,
                            probabilities=code.sampling_probabilities(), seed=seed)
    inside = (points.abs() < 1).all(1)
    row, column = canvas_to_pixel(points[inside], resolution).long().clamp(0, resolution - 1).unbind(1)
    bins.view(-1).scatter_add_(0, row * resolution + column, torch.full_like(column, 1 / len(points), dtype=bins.dtype))
    estimate = levels.measure(levels.render(code, resolution, seed).to(masses))
    if not bool(estimate.any()):  # too thin for a binary image
        return torch.ones_like(masses)
    usual = 1 / estimate.sum()
    known, shown, seen = (avg_pool2d(image[None, None], WINDOW, 1, WINDOW // 2)[0, 0]
                          for image in (bins, estimate, masses))
    ratio = torch.where(shown > 1e-9, (known / usual + WEAK) / (shown + WEAK), 1)
    agreement = (torch.minimum(shown, seen) / torch.maximum(shown, seen).clamp_min(1e-9)) ** TRUST
    return ratio**agreement
