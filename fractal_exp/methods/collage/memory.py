"""What collage search takes of memory, and how it makes do with less."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ...errors import InputError
from ...rendering.still import tile_side
from .picture import FINEST

GIB = 2**30
POINTS = 96 * 2**20      # bytes of the points of a chaos game, with what is computed of them on the way
IMAGES = 16              # float32 images of the picture's size that are there at once
ENOUGH = 4               # maps that move together, for which the picture is rather searched at a smaller size


@dataclass(frozen=True)
class MemoryBudget:
    """So many GiB (None: no limit) for an image of `resolution`² pixels, drawn on `supersample`² subpixels a pixel.

    What grows is the derivatives of the picture by the maps, 24 bytes a map and pixel: with little memory the picture
    is searched at a smaller size, and fewer maps are polished at once. The interpreter and its libraries, about
    0.8 GiB, come on top. Raises `InputError` where not even one map could be polished.
    """

    gib: float | None
    resolution: int
    supersample: int

    def __post_init__(self) -> None:
        if self.gib is not None and self.maps_at_once(self.resolution) < 1:
            least = math.ceil(100 * self._bytes(self.resolution, 1) / GIB) / 100
            raise InputError(f"collage search of an image of {self.resolution}² pixels takes at least {least} GiB, got "
                             f"memory_gib={self.gib}; allow that much, or read the picture at a lower resolution")

    def size(self, largest: int) -> int:
        """The side in pixels at which to search: the picture's, or the largest whole fraction of it that is at most
        `largest` and leaves memory for enough maps at once."""
        step = math.ceil(self.resolution / largest)
        while self.maps_at_once(self.resolution // step) < ENOUGH and self.resolution // step > 64:
            step += 1
        return self.resolution // step

    def maps_at_once(self, resolution: int) -> int:
        """How many maps can be polished together on a picture of this size."""
        if self.gib is None:
            return 1_000_000
        return int((self.gib * GIB - self._bytes(resolution, 0)) / (self._bytes(resolution, 1)
                                                                   - self._bytes(resolution, 0)))

    def _bytes(self, resolution: int, maps: int) -> float:
        """Of a search at this size with so many maps polished at once."""
        canvas = (tile_side(resolution, self.supersample) * self.supersample)**2
        columns = maps * 24 * min(resolution, FINEST)**2
        return POINTS + canvas + IMAGES * 4 * self.resolution**2 + columns * 4 / 3  # each grid is a quarter of the last
