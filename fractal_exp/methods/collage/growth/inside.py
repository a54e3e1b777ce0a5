"""SSIM inside a shape, as a part of a loss."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from ....evaluation.inside import AROUND_PX, C1, C2, REACH, SIGMA_PX, shape_level
from ....ops.filters import filtered

RADIUS = round(REACH * SIGMA_PX)   # of the window, pixels


class InsideSsim:
    """The sum of the SSIM map of images against a picture `grey` (R,R), over the pixels within `AROUND_PX` of the
    picture's shape, of those that it `shows` (R,R). What the map takes from the picture alone is computed once."""

    def __init__(self, grey: Tensor, shows: Tensor):
        from scipy.ndimage import distance_transform_edt

        shape = (grey > shape_level(grey)).numpy()
        mask = torch.from_numpy(np.asarray(distance_transform_edt(~shape)) <= AROUND_PX)
        rows, columns = (mask.any(axis).nonzero().flatten() for axis in (1, 0))
        self.box = tuple(slice(max(0, int(each[0]) - RADIUS), int(each[-1]) + 1 + RADIUS) for each in (rows, columns))
        self.grey, self.inside = grey[self.box], mask[self.box] * shows[self.box]
        along = torch.arange(-RADIUS, RADIUS + 1) / SIGMA_PX
        window = (-along.square() / 2).exp()
        self.window = (window / window.sum()).tolist()
        self.mean, square = filtered(torch.stack([self.grey, self.grey.square()]), self.window)
        self.variance = square - self.mean.square()

    def slope(self, shown: Tensor) -> Tensor:
        """The gradient (R,R) of the sum by an image (R,R)."""
        slope, part = torch.zeros_like(shown), shown[self.box]
        mean, square, product = filtered(torch.stack([part, part.square(), part * self.grey]), self.window)
        of_means, of_both = 2 * mean * self.mean + C1, 2 * (product - mean * self.mean) + C2
        means, both = mean.square() + self.mean.square() + C1, square - mean.square() + self.variance + C2
        each = self.inside / (means * both)
        ssim = each * of_means * of_both
        by_square, by_product = -ssim / both, 2 * each * of_means
        by_mean = 2 * each * self.mean * (of_both - of_means) + 2 * mean * ssim * (1 / both - 1 / means)
        # The window is even, so its transpose is itself.
        by_mean, by_square, by_product = filtered(torch.stack([by_mean, by_square, by_product]), self.window)
        slope[self.box] = by_mean + 2 * part * by_square + self.grey * by_product
        return slope
