"""The network behind the perceptual distance `fractal`: its layers, and the files of its weights."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

from ..errors import InputError
from ..runtime import weights

NAME = "fractal_features"                 # in files
CHANNELS = (8, 24, 48, 64, 96, 128, 128)  # of the seven levels, at a half, a quarter … a 64th of the image's side; the
STRIDES = (2, 2, 2, 2, 2, 2, 1)           # last is as coarse as the one before and sees 257 pixels a side
KERNELS = (5, 3, 3, 3, 3, 3, 3)
TAPS = (2, 4, 6, 8, 10, 12, 14)           # features are read after each level's ReLU
SMALLEST_PX = 32                          # one whole pixel of the fifth level; the padding fills up the last two


class FractalFeatures(nn.Module):
    """What a weight file holds: `layers` from grey images (B,1,H,W), one row (C,) of `channel_weights`, at least 0,
    for each of `TAPS`, and the `recipe` of its training as plain data."""

    def __init__(self, layers: nn.Sequential, channel_weights: Iterable[Tensor], recipe: Mapping[str, Any]):
        super().__init__()
        self.layers, self.recipe = layers, recipe
        self.channel_weights = nn.ParameterList(channel_weights)


def network() -> nn.Sequential:
    """The seven levels, each a convolution and a ReLU: (B,1,H,W) -> (B,128,H/64,W/64).

    On the meta device, where weights take no memory, nor draws of the global random generator: `to_empty` makes room
    for values, `load_state_dict(assign=True)` takes those of a file.
    """
    layers: list[nn.Module] = []
    for before, after, kernel, stride in zip((1, *CHANNELS), CHANNELS, KERNELS, STRIDES, strict=False):
        layers += [nn.Conv2d(before, after, kernel, stride, padding=kernel // 2, device="meta"), nn.ReLU()]
    return nn.Sequential(*layers)


def save(path: str | Path, layers: nn.Sequential, channel_weights: Iterable[Tensor], recipe: Mapping[str, Any]) -> Path:
    """Write a file of weights and return its absolute path. `recipe`: plain data."""
    return weights.save(path, NAME, FractalFeatures(layers, channel_weights, recipe).state_dict(), recipe, {})


def load(path: str | Path | None = None) -> FractalFeatures:
    """The network of a file of weights, float32 on the CPU; without a path that of this package.

    Raises `InputError` on a file that is missing, damaged, of another format or shape, or not finite.
    """
    kept = weights.load(path, NAME)
    found = FractalFeatures(network(), [torch.empty(count, device="meta") for count in CHANNELS], kept.recipe)
    kept.fill(found)
    for key, value in kept.tensors.items():
        if key.startswith("channel_weights.") and bool((value < 0).any()):
            raise InputError(f"{kept.source}: {key} must not be negative, got {float(value.min()):.4g}; a distance has "
                             "weights of at least 0")
    return found
