"""Drawings in colour on a ground of one colour."""

from __future__ import annotations

from torch import Tensor, tensor

from ..errors import InputError
from ..ifs.code import IFS
from ..runtime.checks import shown

BLACK = (0.0, 0.0, 0.0)


def ground_of(text: str) -> tuple[float, float, float]:
    """A colour in words, a name such as "white" or a number such as "#fff8e7", as (red, green, blue) in [0,1].

    Raises `InputError` on anything that Pillow does not know as a colour.
    """
    from PIL import ImageColor

    try:
        red, green, blue = ImageColor.getrgb(text)[:3]
    except ValueError as error:
        raise InputError(f"a colour is a name such as white or a number such as #fff8e7, got {text!r}") from error
    return red / 255, green / 255, blue / 255


def own_ground(code: IFS, default: tuple[float, float, float] = BLACK) -> tuple[float, float, float]:
    """The ground that a code's colours were found on: the colour "ground" in its `meta`, or `default` without one."""
    named = code.meta.get("ground")
    try:
        return ground_of(named) if isinstance(named, str) else default
    except InputError:  # a note of the user's own
        return default


def on_ground(image: Tensor, ground: tuple[float, float, float] = BLACK) -> Tensor:
    """An image (…,4) of the mode "colour" laid on one colour (red, green, blue in [0,1]): (…,3) in [0,1].

    Colours are mixed as they are stored (sRGB), the way in which pictures are shrunk and most programs lay one picture
    on another. Raises `InputError` on another shape or a ground out of range.
    """
    if image.ndim < 1 or image.shape[-1] != 4:
        raise InputError(f'the image must have four channels (…, 4), as render(…, mode="colour") gives it, got '
                         f"{tuple(image.shape)}")
    if len(ground) != 3 or not all(0 <= part <= 1 for part in ground):
        raise InputError(f"the ground must be red, green and blue in [0, 1], got {shown(ground)}")
    cover = image[..., 3:]
    return cover * image[..., :3] + (1 - cover) * tensor(ground, dtype=image.dtype)
