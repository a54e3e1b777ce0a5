"""What a point of the invariant measure costs through all of its images: the adjoint of the measure's equation.

The invariant measure of maps with probabilities p is mu = sum_i p_i f_i#mu. Let a loss rise by s(x) for a little mass
at x. Where a map moves mass to x, all maps copy that mass again and again, so the loss rises by V(x) = s(x) + e(x) with
the echo e(x) = sum_i p_i V(f_i(x)). So the gradient of the loss by the maps is that of their collage of mu, with V in
the place of s. Without the echo, it would be as if mu stood still.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn.functional import interpolate

from ....ops.collage import pushforward
from ....ops.filters import filtered

CELL_PX = 4        # side of a cell: an echo is the mean over many small copies, so it is smooth
MEMORY = 0.9       # of the values in a cell, which are averaged over steps
BLUR = (0.25, 0.5, 0.25)   # of cells
LEAST = 0.05       # of a sample's weight, added to those in a cell: where there is next to none, there is no echo


class Adjoint:
    """The echo on a picture of `side` pixels a side, less its mean over the measure, which no map changes. It is learnt
    along a descent, whose maps move slowly: each step adds one more generation of copies."""

    def __init__(self, side: int):
        self.side, self.cells = side, max(2, side // CELL_PX)
        self.sums = torch.zeros(2, self.cells, self.cells)   # of values, and of the weights of samples

    def echo(self) -> Tensor:
        """e in every pixel (R,R); 0 at first."""
        values, weights = filtered(self.sums, BLUR)
        return interpolate((values / (weights + LEAST))[None, None], 2 * (self.side,), mode="bilinear")[0, 0]

    def learn(self, points: Tensor, values: Tensor) -> None:
        """Points (K,2) of the measure, and sum_i p_i V(f_i(x)) (K,) at each."""
        identity, one = points.new_tensor([[[1.0, 0, 0, 1, 0, 0]]]), points.new_ones(1, 1)
        added = [pushforward(identity, one, torch.cat([points, each[:, None]], 1), self.cells)
                 for each in (values - values.mean(), torch.ones_like(values))]
        self.sums = MEMORY * self.sums + torch.cat(added)
