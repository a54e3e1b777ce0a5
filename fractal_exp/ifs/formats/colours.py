"""Colours of maps, the same in all formats with colours."""

from __future__ import annotations

import numpy as np

COLOURS = 256  # of a palette
# Bright on black and not pale on white. Neighbours also differ in lightness, so they differ in grey.
ANCHORS = np.array([[38, 110, 214], [18, 164, 150], [96, 188, 64], [240, 178, 36], [232, 98, 60], [196, 60, 140]])


def place(index: int, count: int) -> float:
    """Where map `index` of `count` lies on the palette, in [0,1]."""
    return index / max(count - 1, 1)


def ramp(places: np.ndarray) -> np.ndarray:
    """Colours (…,3), uint8, at places (…) in [0,1] of the palette."""
    knots = np.linspace(0, 1, len(ANCHORS))
    return np.rint(np.stack([np.interp(places, knots, channel) for channel in ANCHORS.T], -1)).astype(np.uint8)
