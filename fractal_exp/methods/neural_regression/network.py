"""The network: from an image to the numbers of so many maps, as deviations from the identity.

Source: Graham and Demers, "Applying Neural Networks to a Fractal Inverse Problem" (2021), with the residual design of
"Learning Image Fractals" (Eurographics 2025, section 5.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from torch import Tensor, nn

IDENTITY = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)  # a b c d e f of x' = a x + b y + e, y' = c x + d y + f
MEAN, SPREAD = 0.07, 0.16  # of the grey levels of the suite's pictures, about
LAST = 0.01                # standard deviation of the last layer's first weights


class RegressionNetwork(nn.Module):
    """Blocks of a convolution 3×3, ReLU and pooling by 2, then `hidden` numbers, then 6 for each map.

    side: pixels of the input, a multiple of 2 to the number of blocks; channels: of each block; residual: scale of the
    deviations; linear: without the activation between the dense layers, as released. First weights are He's,
    those of the last layer nearly 0, from torch's global generator.
    """

    def __init__(self, side: int, maps: int, channels: Sequence[int], hidden: int, residual: float, linear: bool):
        super().__init__()
        layers: list[nn.Module] = []
        for before, after in pairwise((1, *channels)):
            layers += [nn.Conv2d(before, after, 3, padding=1), nn.ReLU(), nn.MaxPool2d(2)]
        flat = channels[-1] * (side >> len(channels)) ** 2
        layers += [nn.Flatten(), nn.Linear(flat, hidden), *([] if linear else [nn.ReLU()]),
                   nn.Linear(hidden, 6 * maps)]
        self.layers, self.maps, self.residual = nn.Sequential(*layers), maps, residual
        for layer in layers:
            if isinstance(layer, (nn.Conv2d, nn.Linear)):
                nn.init.kaiming_normal_(layer.weight)
                nn.init.zeros_(layer.bias)  # pyright: ignore[reportArgumentType]
        nn.init.normal_(layers[-1].weight, std=LAST)  # pyright: ignore[reportArgumentType]

    def forward(self, images: Tensor) -> Tensor:
        """Codes (B,N,6), rows a b c d e f, from images (B,S,S) in [0,1]."""
        deviation = self.layers((images[:, None] - MEAN) / SPREAD).unflatten(-1, (self.maps, 6))
        return deviation.new_tensor(IDENTITY) + self.residual * deviation
