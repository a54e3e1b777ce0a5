"""Colours of a code: what each map gives to the colour of a point."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..errors import InputError
from .numbers import exact, floats, only_keys, only_numbers, same


@dataclass(frozen=True, eq=False)
class Colours:
    """A colour and a blend for each of N maps.

    A point of the chaos game has a colour c beside its place x. When map i moves it, x <- f_i(x) and
    c <- (1 - b_i) c + b_i c_i. So under a word of maps the colour changes by an affine map too, c -> k c + t with
    numbers k in [0,1] and t (3,), and has its own value at every depth of the attractor. This is the colour coordinate
    of fractal flames (Draves and Reckase 2003), with red, green and blue in place of a place on a palette.

    - rgb (N,3): the colours c_i, red, green and blue in [0,1] as a picture stores them (sRGB).
    - blends (N,): the b_i in [0,1]. With 1, the map's last use decides the colour; with 0, the map leaves it alone.

    Both are kept as float32 tensors. Raises `InputError` on other shapes, on numbers out of range or not finite, and if
    all blends are 0, because then no map gives a colour.
    """

    rgb: Tensor
    blends: Tensor

    def __post_init__(self) -> None:
        rgb, blends = floats("rgb", self.rgb), floats("blends", self.blends)
        if rgb.ndim != 2 or rgb.shape[1] != 3 or rgb.shape[0] < 1:
            raise InputError(f"rgb must have shape (N, 3) with N >= 1, red, green and blue of each map, got "
                             f"{tuple(rgb.shape)}")
        if blends.shape != (rgb.shape[0],):
            raise InputError(f"blends must have shape ({rgb.shape[0]},) as there are {rgb.shape[0]} colours, got "
                             f"{tuple(blends.shape)}")
        for name, values in (("rgb", rgb), ("blends", blends)):
            low, high = float(values.min()), float(values.max())
            if low < 0 or high > 1:
                raise InputError(f"{name} must lie in [0, 1], got {low:.4g} to {high:.4g}"
                                 + ("; divide 8-bit colours by 255" if name == "rgb" else ""))
        if not bool((blends > 0).any()):
            raise InputError("at least one blend must be above 0: with blends of 0 alone, no map gives a colour")
        object.__setattr__(self, "rgb", rgb)
        object.__setattr__(self, "blends", blends)

    def __eq__(self, other: object) -> bool:
        return same(self.rgb, other.rgb) and same(self.blends, other.blends) if isinstance(other, Colours) else False

    def __hash__(self) -> int:
        return hash((tuple(self.rgb.flatten().tolist()), tuple(self.blends.tolist())))

    def __len__(self) -> int:
        """The number of maps N."""
        return self.rgb.shape[0]

    def __repr__(self) -> str:
        shown = (255 * self.rgb).round().int().tolist()
        pairs = [f"#{r:02x}{g:02x}{b:02x} by {blend:.2g}"
                 for (r, g, b), blend in zip(shown, self.blends.tolist(), strict=True)]
        return f"Colours({', '.join(pairs)})"

    def to(self, device: torch.device | str) -> Colours:
        """The same colours on another device."""
        return Colours(self.rgb.to(device), self.blends.to(device))

    def of_maps(self, maps: Any) -> Colours:
        """The colours of some of the maps, in the order given: a mask (N,) or a list of their numbers from 0 on. Use it
        when maps are permuted or removed, so that each keeps its own colour. Raises `InputError` if none of them has a
        blend above 0."""
        return Colours(self.rgb[maps], self.blends[maps])

    def shares(self, probabilities: Tensor) -> Tensor:
        """The share (N,) that each map's colour has in the mean colour of the attractor's points, with sum 1.

        probabilities (N,): of the maps in the chaos game. Raises `InputError` if all maps with a blend above 0 have the
        probability 0, because then no point gets a colour.
        """
        weights = self.blends.cpu() * probabilities.cpu()
        if not bool((weights > 0).any()):
            raise InputError("every map of the code with a blend above 0 has the probability 0, so no point gets a "
                             "colour; give another map a blend above 0")
        return weights / weights.sum()

    def to_json(self) -> dict[str, Any]:
        """Plain data: `rgb` as N lists of three numbers, and N `blends`."""
        return {"rgb": exact(self.rgb), "blends": exact(self.blends)}

    @classmethod
    def from_json(cls, data: Any) -> Colours:
        """The colours from what `to_json` gives. Raises `InputError` on anything else."""
        if not isinstance(data, Mapping):
            raise InputError(f"colours are an object with rgb and blends, got {type(data).__name__}")
        only_keys(data, {"rgb", "blends"}, "an object of colours")
        missing = [key for key in ("rgb", "blends") if key not in data]
        if missing:
            raise InputError(f"the colours have no {' and no '.join(missing)}")
        return cls(only_numbers("rgb", data["rgb"]), only_numbers("blends", data["blends"]))
