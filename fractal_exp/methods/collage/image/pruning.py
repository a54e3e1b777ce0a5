"""Maps that an image does not ask for."""

from __future__ import annotations

from dataclasses import dataclass

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
