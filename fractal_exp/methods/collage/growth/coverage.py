"""Many maps, moved together until the images of a shape cover the shape.

The collage theorem (Barnsley 1985) holds for shapes as it does for measures, and the attractor of small maps is very
nearly the union of their images of the shape. We compare what the pixels of this union show. It does not depend on how
densely a map fills its image: a pixel that is covered twice is no brighter.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ....ops.collage.reference import BETA_1, BETA_2, EPSILON, contract, pushforward
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..params.growth import GrowthParams
from .silhouette import Silhouette, widened


def areas(maps: Tensor, shape: Silhouette, params: GrowthParams, generator: torch.Generator) -> Tensor:
    """The number of pixels (N,) that the images of a shape under maps (N,6) cover. A thin image covers more subpixels
    than its determinant suggests; for a large image there are too few points to count its subpixels."""
    places, side = shape.points(params.area_points, generator), shape.side * params.subpixels
    cells = []
    for row in ((0, 1, 4), (2, 3, 5)):
        along = maps[:, row[0], None] * places[:, 0] + maps[:, row[1], None] * places[:, 1] + maps[:, row[2], None]
        cells.append(((along + 1) * (side / 2)).long().clamp(0, side - 1))
    code = (cells[0] * side + cells[1]).sort(1).values
    counted = 1 + (code.diff(dim=1) != 0).sum(1)
    return torch.maximum(_determinants(maps) * shape.area, counted / params.subpixels**2)


def _determinants(maps: Tensor) -> Tensor:
    return (maps[:, 0] * maps[:, 3] - maps[:, 1] * maps[:, 2]).abs()


class Uncovered:
    """How far the union of images is from a shape; lower is better.

    A pixel whose covered share is b shows b^p / (b^p + h^p), with h = `half` and p = `power`: hardly anything for a
    stray point, and nearly white from a third. The loss of these shades is 1 - F1 within a pixel, plus `exact` times
    the same to the pixel, plus `coarse` times the mean difference of blocks of pixels (which shows a map where light is
    missing far away), plus `far` times the distance of what lies off the shape.
    """

    def __init__(self, shape: Silhouette, params: GrowthParams):
        self.shape, self.params = shape, params
        self.asked, self.allowed = shape.mask.float(), widened(shape.mask)
        self.distance = (shape.distances() / params.far_px).clamp_max(params.farthest)
        self.blocks = [k for k in params.blocks if k <= shape.side]

    def shades(self, bins: Tensor) -> Tensor:
        """The shades (R,R) of pixels, from their covered shares."""
        power = ((bins + 1e-9) / self.params.half) ** self.params.power
        return power / (1 + power)

    def __call__(self, bins: Tensor) -> Tensor:
        """The loss of the covered shares (R,R) of all pixels."""
        params, asked = self.params, self.asked
        shade = self.shades(bins)
        covered = avg_pool2d(bins[None, None], 3, 1, 1)[0, 0] * (9 * params.around)
        near = torch.maximum(shade, self.shades(covered))
        light, wanted = shade.sum().clamp_min(1e-6), asked.sum()
        precision, recall = (shade * self.allowed).sum() / light, (near * asked).sum() / wanted
        loss = 1 - 2 * precision * recall / (precision + recall).clamp_min(1e-6)
        loss = loss + params.exact * (1 - 2 * (shade * asked).sum() / (light + wanted))
        loss = loss + params.far * (shade * self.distance).sum() / light
        for k in self.blocks:
            off = avg_pool2d((shade - asked)[None], k).abs().sum() * k**2 / wanted
            loss = loss + params.coarse * off / (2 * len(self.blocks))
        return loss


def covering(maps: Tensor, loss: Uncovered, steps: int, generator: torch.Generator,
             deadline: Deadline = NO_DEADLINE) -> Tensor:
    """Maps (N,6) after `steps` of Adam on the loss, all moved together. Each step takes new points of the shape. The
    areas of the images are counted every `recount` steps. In between they follow the determinants to the power
    `area_power`, because a wider line covers more."""
    shape, params = loss.shape, loss.params
    moved, most = params.points_per_pixel * shape.side**2, params.area_change
    count = max(params.least_points, min(round(moved / len(maps)), params.most_points))
    moving = maps.detach().clone().requires_grad_()
    adam = torch.optim.Adam([moving], params.rate, (BETA_1, BETA_2), EPSILON)
    covered = volume = maps.new_zeros(len(maps))
    for k in range(steps):
        if deadline.passed:
            break
        if k % params.recount == 0:
            with torch.no_grad():
                covered, volume = areas(moving, shape, params, generator), _determinants(moving)
        places = shape.points(count, generator)
        samples = torch.cat([places, torch.full((count, 1), 1 / count)], 1)
        with torch.enable_grad():
            change = ((_determinants(moving) + 1e-6) / (volume + 1e-6)).clamp(1 / most, most)
            light = covered * change ** params.area_power
            error = loss(pushforward(moving[None], light[None], samples, shape.side)[0])
            moving.grad, = torch.autograd.grad(error, moving)
        adam.param_groups[0]["lr"] = params.rate * params.decay ** ((k + 1) / steps)
        adam.step()
        with torch.no_grad():
            moving.copy_(contract(moving, params.largest))
    return moving.detach()
