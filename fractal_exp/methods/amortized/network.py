"""The network: a residual convolutional encoder that knows where it looks, and as many questions as there may be maps.

Source: Yamaguti, "Amortized Set Prediction for Inverse IFS Reconstruction from Density Maps" (2026).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
import torch.nn.functional as F
from torch import Tensor, nn

MEAN, SPREAD = 0.07, 0.16  # of the grey levels of the suite's pictures, about
GROUPS = 4                 # of channels that are normalised together


class ResidualBlock(nn.Module):
    """Two convolutions, the first of which halves the image, beside a shortcut."""

    def __init__(self, before: int, after: int):
        super().__init__()
        self.first = nn.Conv2d(before, after, 3, 2, padding=1)
        self.second = nn.Conv2d(after, after, 3, padding=1)
        self.norms = nn.ModuleList(nn.GroupNorm(GROUPS, after) for _ in range(2))
        self.shortcut = nn.Conv2d(before, after, 1, 2)

    def forward(self, x: Tensor) -> Tensor:
        """(B,C,H,W) to (B,C',H/2,W/2)."""
        inner = F.relu(self.norms[0](self.first(x)))
        return F.relu(self.shortcut(x) + self.norms[1](self.second(inner)))


class SetNetwork(nn.Module):
    """From images to maps and whether each is there.

    maps: how many there may be; channels: of the blocks, each of which halves the side, multiples of 4; heads: of the
    attention that pools the last block's pixels into a feature for each map; hidden: numbers of the perceptron that
    reads it. First weights are from torch's global generator.
    """

    def __init__(self, maps: int, channels: Sequence[int], heads: int, hidden: int):
        super().__init__()
        self.blocks = nn.Sequential(*(ResidualBlock(*pair) for pair in pairwise((3, *channels))))
        self.place = nn.Linear(2, channels[-1])
        self.questions = nn.Parameter(torch.randn(maps, channels[-1]))
        self.pooling = nn.MultiheadAttention(channels[-1], heads, batch_first=True)
        self.answer = nn.Sequential(nn.LayerNorm(channels[-1]), nn.Linear(channels[-1], hidden), nn.ReLU(),
                                    nn.Linear(hidden, 7))

    def forward(self, images: Tensor) -> tuple[Tensor, Tensor]:
        """Maps (B,M,6), rows a b c d e f, and logits (B,M) of their being there, from images (B,S,S) in [0,1]."""
        seen = torch.cat([((images - MEAN) / SPREAD)[:, None], _places(images).expand(len(images), -1, -1, -1)], 1)
        features = self.blocks(seen)
        places = _places(features).flatten(2).transpose(1, 2)
        pixels = features.flatten(2).transpose(1, 2) + self.place(places)
        questions = self.questions.expand(len(images), -1, -1)
        pooled, _ = self.pooling(questions, pixels, pixels, need_weights=False)
        found = self.answer(questions + pooled)
        return found[..., :6], found[..., 6]


def _places(images: Tensor) -> Tensor:
    """The coordinates (1,2,H,W) of the pixels of square images, x to the right and y up, in [-1,1]."""
    side = images.shape[-1]
    centers = (2 * torch.arange(side, device=images.device, dtype=torch.float32) + 1) / side - 1
    y, x = torch.meshgrid(-centers, centers, indexing="ij")
    return torch.stack([x, y])[None]
