"""The numba kernel of `colouring`: the mean colour coordinate of pixels, and how it depends on the blends."""

from __future__ import annotations

import numpy as np

from ..runtime.jit import kernel


@kernel()
def walked(letters, pixels, rgb, blends, share, count, warm_up):
    """Sums over the points of chaos games that fell into each of `count` pixels: the weight of every map's colour
    (P,N), and the derivative of the colour by every blend (P,N,3).

    letters, pixels (T,K): the map of each step of K games, and the pixel of the point after it or -1; the first
    `warm_up` steps are not summed. rgb (N,3), blends (N,). share (N,): the weights of the colours at the start.
    """
    steps, games = letters.shape
    maps = len(blends)
    weights, slopes = np.zeros((count, maps)), np.zeros((count, maps, 3))
    mean = share @ rgb
    for game in range(games):
        weight, colour, slope = share.copy(), mean.copy(), np.zeros((maps, 3))
        for step in range(steps):
            i, pixel = letters[step, game], pixels[step, game]
            keep = 1 - blends[i]
            for m in range(maps):
                weight[m] *= keep
                for channel in range(3):
                    slope[m, channel] *= keep
            weight[i] += blends[i]
            for channel in range(3):
                slope[i, channel] += rgb[i, channel] - colour[channel]
                colour[channel] = keep * colour[channel] + blends[i] * rgb[i, channel]
            if step >= warm_up and pixel >= 0:
                for m in range(maps):
                    weights[pixel, m] += weight[m]
                    for channel in range(3):
                        slopes[pixel, m, channel] += slope[m, channel]
    return weights, slopes
