"""Maps that a picture does not ask for."""

from __future__ import annotations

from collections.abc import Callable

from .frame import Frame
from .picture import Drawn, Picture
from .polish import never


def without_superfluous(picture: Picture, drawn: Drawn, price: float, least: int, *, near: bool,
                        late: Callable[[], bool] = never) -> Drawn:
    """As `needed`, of a polished code: where it is nearly found, a map that nobody sees may still decide the frame."""
    framed = picture.within(Frame.of(picture.image) if near else None)
    fewer = needed(framed, framed.judge(drawn.maps, drawn.weights), price, least, late=late)
    return drawn if len(fewer.maps) == len(drawn.maps) else picture.judge(fewer.maps, fewer.weights)


def needed(picture: Picture, drawn: Drawn, price: float, least: int = 0, *, late: Callable[[], bool] = never) -> Drawn:
    """The code without the maps that the picture does not ask for, at a price a map; at least so many stay."""
    while len(drawn.maps) > max(2, least) and not late():
        fewer = min((picture.without(drawn, [i]) for i in range(len(drawn.maps))), key=lambda each: each.error)
        if fewer.error >= drawn.error + price:
            break
        drawn = fewer
    return drawn
