"""Maps that an image does not ask for."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from .objective import ImageObjective, Rendered


@dataclass(frozen=True)
class Price:
    """What a map costs: an error, and a share of the code's error, which counts where more than noise is left of the
    true code's."""

    error: float
    share: float = 0.0

    def score(self, error: float, maps: int) -> float:
        """Of a code with this error and so many maps; less is better."""
        return error * (1 + self.share) ** maps + self.error * maps

    def spares(self, fewer: float, error: float) -> bool:
        """Whether a map is not worth it that lowers the error from `fewer` to `error`."""
        return fewer < error * (1 + self.share) + self.error


def without_doubles(maps: Tensor, weights: Tensor, points: Tensor, near: float) -> tuple[Tensor, Tensor]:
    """The maps (N,6) and weights (N,) without those that send points (P,2) to where a heavier one sends them, but for
    `near` canvas units (rms): two that are nearly the same only make a line thicker, which is the pen's part."""
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
    """As `pruned`, of a polished code: where it is nearly found, a map that nobody sees may still decide the frame."""
    framed = objective.within(objective.own_frame() if near else None)
    fewer = pruned(framed, framed.judge(rendered.maps, rendered.weights), price, least, deadline=deadline)
    return rendered if len(fewer.maps) == len(rendered.maps) else objective.judge(fewer.maps, fewer.weights)


def pruned(objective: ImageObjective, rendered: Rendered, price: Price, least: int = 0, *,
           deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code without the maps that the image does not ask for, at a price a map; at least so many stay."""
    while len(rendered.maps) > max(2, least) and not deadline.passed:
        fewer = min((objective.without(rendered, [i]) for i in range(len(rendered.maps))), key=lambda each: each.error)
        if not price.spares(fewer.error, rendered.error):
            break
        rendered = fewer
    return rendered
