"""Remove maps that the image does not justify."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.objective import ImageObjective, Rendered


@dataclass(frozen=True)
class Price:
    """The cost of a map: an error, plus a share of the code's error. The share counts where even the true code's error
    is more than noise."""

    error: float
    share: float = 0.0

    def score(self, error: float, maps: int) -> float:
        """The score of a code with this error and number of maps; lower is better."""
        return error * (1 + self.share) ** maps + self.error * maps

    def spares(self, fewer: float, error: float) -> bool:
        """Whether a map that lowers the error from `fewer` to `error` is not worth its price."""
        return fewer < error * (1 + self.share) + self.error


def without_doubles(maps: Tensor, weights: Tensor, points: Tensor, near: float) -> tuple[Tensor, Tensor]:
    """Maps (N,6) and weights (N,) without doubles. A map is a double if it sends points (P,2) to within `near` canvas
    units (rms) of where a heavier map sends them. It only makes a line thicker, which is the pen's job."""
    images = points @ maps[:, :4].unflatten(1, (2, 2)).transpose(1, 2) + maps[:, None, 4:]
    apart = (images[:, None] - images[None]).square().sum(-1).mean(-1).sqrt()
    kept: list[int] = []
    for i in weights.argsort(descending=True, stable=True).tolist():
        same = [k for k in kept if float(apart[i, k]) < near]
        if same:
            weights = weights.index_add(0, torch.tensor(same[:1], device=weights.device), weights[i:i + 1])
        else:
            kept.append(i)
    kept.sort()
    return maps[kept], weights[kept]


def pruned_in_frame(objective: ImageObjective, rendered: Rendered, price: Price, least: int, *, near: bool,
                    deadline: Deadline = NO_DEADLINE) -> Rendered:
    """Like `pruned`, for a polished code. In a nearly right code, even a map that nobody sees may decide the frame."""
    framed = objective.within(objective.own_frame() if near else None)
    fewer = pruned(framed, framed.judge(rendered.maps, rendered.weights), price, least, deadline=deadline)
    return rendered if len(fewer.maps) == len(rendered.maps) else objective.judge(fewer.maps, fewer.weights)


def pruned(objective: ImageObjective, rendered: Rendered, price: Price, least: int = 0, *,
           deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code without maps that are not worth their price. At least `least` maps stay, and at least two; all of them
    without `MoveParams.pruning`."""
    while objective.params.moves.pruning and len(rendered.maps) > max(2, least) and not deadline.passed:
        fewer = min((objective.without(rendered, [i]) for i in range(len(rendered.maps))), key=lambda each: each.error)
        if not price.spares(fewer.error, rendered.error):
            break
        rendered = fewer
    return rendered
