"""How far the colours of a code are from those of a picture."""

from __future__ import annotations

import numpy as np

from ..ifs.code import IFS
from ..images.painted import Painted
from ..runtime.extras import need
from .drawing import mean_colours


def colour_error(code: IFS, painted: Painted, seed: int = 0) -> float | None:
    """The mean CIEDE2000 difference between a code's colours and a picture's, over the pixels that both light.

    The code, in the frame of the picture's canvas, is drawn at the resolution of `painted`. Its mean colour in a pixel
    is laid on the picture's ground with the picture's own cover, and compared with what the picture shows there. So the
    error is one of colours alone; F1 tells how alike the shapes are. 1 is about the least difference that is seen side
    by side, and 100 that of black and white. None if no pixel is lit in both. Raises `InputError` if the code has no
    colours or scikit-image is missing (Sharma, Wu and Dalal 2005 give the formula).
    """
    need("skimage")
    from skimage.color import deltaE_ciede2000, rgb2lab

    drawn = mean_colours(code, len(painted.lit), seed).numpy()
    both = painted.lit & (drawn[..., 3] > 0)
    if not both.any():
        return None
    cover = painted.cover[both][:, None]
    shown = cover * drawn[both][:, :3] + (1 - cover) * painted.ground
    return float(np.mean(deltaE_ciede2000(rgb2lab(painted.seen[both]), rgb2lab(shown))))
