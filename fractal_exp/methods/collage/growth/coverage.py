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
from .paving import LARGEST
from .silhouette import Silhouette, widened

# Of areas.
SUBPIXELS = 16           # per side of a pixel, in which the images of points are counted
AREA_POINTS = 6000       # of the shape whose images are counted
RECOUNT = 25             # steps between two counts
AREA_POWER = 0.7         # of the determinants, which areas follow between two counts: a wider line covers more
AREA_CHANGE = 5.0        # maximum factor by which a determinant counts as grown or shrunk since the last count
# Of the shade of a pixel.
HALF = 0.1               # covered share that shows half white
POWER = 1.5              # steepness with which the shade rises with the covered share
AROUND = 0.5             # share of the cover of a pixel's 3 × 3 neighbourhood that counts in the recall within a pixel
# Weights in the loss, in which the F1 within a pixel has weight 1.
EXACT = 0.3              # of the F1 to the pixel
COARSE = 0.3             # of the brightness of blocks of pixels: it shows a map where light is missing far away
BLOCKS = 4, 8, 16        # pixels per side of these blocks
FAR = 0.05               # of the distance of what lies off the shape
FAR_PX, FARTHEST = 8.0, 3.0   # unit of this distance, pixels, and its maximum in that unit
# Of the descent.
RATE, DECAY = 0.02, 0.05     # learning rate at the first step, canvas units; its share that is left at the last step
POINTS_PER_PIXEL = 0.9       # points of the shape that all maps together move in a step, per pixel of the picture
LEAST_POINTS, MOST_POINTS = 300, 8000   # that each map moves


def areas(maps: Tensor, shape: Silhouette, generator: torch.Generator) -> Tensor:
    """The number of pixels (N,) that the images of a shape under maps (N,6) cover. A thin image covers more subpixels
    than its determinant suggests; for a large image there are too few points to count its subpixels."""
    places, side = shape.points(AREA_POINTS, generator), shape.side * SUBPIXELS
    cells = []
    for row in ((0, 1, 4), (2, 3, 5)):
        along = maps[:, row[0], None] * places[:, 0] + maps[:, row[1], None] * places[:, 1] + maps[:, row[2], None]
        cells.append(((along + 1) * (side / 2)).long().clamp(0, side - 1))
    code = (cells[0] * side + cells[1]).sort(1).values
    counted = 1 + (code.diff(dim=1) != 0).sum(1)
    return torch.maximum(_determinants(maps) * shape.area, counted / SUBPIXELS**2)


def _determinants(maps: Tensor) -> Tensor:
    return (maps[:, 0] * maps[:, 3] - maps[:, 1] * maps[:, 2]).abs()


class Uncovered:
    """How far the union of images is from a shape; lower is better.

    A pixel whose covered share is b shows b^p / (b^p + h^p), with h = `HALF` and p = `POWER`: hardly anything for a
    stray point, and nearly white from a third. The loss of these shades is 1 - F1 within a pixel, plus `EXACT` times
    the same to the pixel, plus `COARSE` times the mean difference of blocks of pixels, plus `FAR` times the distance of
    what lies off the shape.
    """

    def __init__(self, shape: Silhouette):
        self.shape = shape
        self.asked, self.allowed = shape.mask.float(), widened(shape.mask)
        self.distance = (shape.distances() / FAR_PX).clamp_max(FARTHEST)
        self.blocks = [k for k in BLOCKS if k <= shape.side]

    def shades(self, bins: Tensor) -> Tensor:
        """The shades (R,R) of pixels, from their covered shares."""
        power = ((bins + 1e-9) / HALF) ** POWER
        return power / (1 + power)

    def __call__(self, bins: Tensor) -> Tensor:
        """The loss of the covered shares (R,R) of all pixels."""
        asked = self.asked
        shade = self.shades(bins)
        covered = avg_pool2d(bins[None, None], 3, 1, 1)[0, 0] * (9 * AROUND)
        near = torch.maximum(shade, self.shades(covered))
        light, wanted = shade.sum().clamp_min(1e-6), asked.sum()
        precision, recall = (shade * self.allowed).sum() / light, (near * asked).sum() / wanted
        loss = 1 - 2 * precision * recall / (precision + recall).clamp_min(1e-6)
        loss = loss + EXACT * (1 - 2 * (shade * asked).sum() / (light + wanted))
        loss = loss + FAR * (shade * self.distance).sum() / light
        for k in self.blocks:
            off = avg_pool2d((shade - asked)[None], k).abs().sum() * k**2 / wanted
            loss = loss + COARSE * off / (2 * len(self.blocks))
        return loss


def covering(maps: Tensor, loss: Uncovered, steps: int, generator: torch.Generator,
             deadline: Deadline = NO_DEADLINE) -> Tensor:
    """Maps (N,6) after `steps` of Adam on the loss, all moved together. Each step takes new points of the shape. The
    areas of the images are counted every `RECOUNT` steps. In between they follow the determinants."""
    shape = loss.shape
    count = max(LEAST_POINTS, min(round(POINTS_PER_PIXEL * shape.side**2 / len(maps)), MOST_POINTS))
    moving = maps.detach().clone().requires_grad_()
    adam = torch.optim.Adam([moving], RATE, (BETA_1, BETA_2), EPSILON)
    covered = volume = maps.new_zeros(len(maps))
    for k in range(steps):
        if deadline.passed:
            break
        if k % RECOUNT == 0:
            with torch.no_grad():
                covered, volume = areas(moving, shape, generator), _determinants(moving)
        places = shape.points(count, generator)
        samples = torch.cat([places, torch.full((count, 1), 1 / count)], 1)
        with torch.enable_grad():
            change = ((_determinants(moving) + 1e-6) / (volume + 1e-6)).clamp(1 / AREA_CHANGE, AREA_CHANGE)
            light = covered * change ** AREA_POWER
            error = loss(pushforward(moving[None], light[None], samples, shape.side)[0])
            moving.grad, = torch.autograd.grad(error, moving)
        adam.param_groups[0]["lr"] = RATE * DECAY ** ((k + 1) / steps)
        adam.step()
        with torch.no_grad():
            moving.copy_(contract(moving, LARGEST))
    return moving.detach()
