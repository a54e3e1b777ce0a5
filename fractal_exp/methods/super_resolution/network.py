"""SwinIR for classical super-resolution, made of torchvision's Swin transformer blocks.

Source: Liang et al., "SwinIR: Image Restoration Using Swin Transformer" (2021), section 3.
"""

from __future__ import annotations

from torch import Tensor, nn

from ...runtime.extras import need

MLP_RATIO = 2.0  # hidden numbers of a block's perceptron for each of its inputs


class ResidualGroup(nn.Module):
    """Swin blocks, every other one with shifted windows, and a convolution; what comes in is added."""

    def __init__(self, width: int, layers: int, heads: int, window: int):
        super().__init__()
        from torchvision.models.swin_transformer import SwinTransformerBlock

        self.blocks = nn.Sequential(*(
            SwinTransformerBlock(width, heads, [window, window], [layer % 2 * (window // 2)] * 2, MLP_RATIO)
            for layer in range(layers)))
        self.convolution = nn.Conv2d(width, width, 3, padding=1)

    def forward(self, features: Tensor) -> Tensor:
        """Features (B,C,H,W) to the same."""
        mixed = self.blocks(features.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        return features + self.convolution(mixed)


class SwinIR(nn.Module):
    """From grey images (B,H,W) in [0,1] to (B,fH,fW), f a power of 2.

    width: channels of the deep features; groups: residual ones, of `layers` Swin blocks each; heads: of the attention;
    window: pixels a side within which pixels attend to each other; features: channels of the upsampling. Raises
    `InputError` without torchvision.
    """

    def __init__(self, width: int, groups: int, layers: int, heads: int, window: int, features: int, factor: int):
        super().__init__()
        need("torchvision")
        self.shallow = nn.Conv2d(1, width, 3, padding=1)
        self.deep = nn.Sequential(*(ResidualGroup(width, layers, heads, window) for _ in range(groups)))
        self.norm = nn.LayerNorm(width)
        self.joined = nn.Conv2d(width, width, 3, padding=1)
        stages: list[nn.Module] = [nn.Conv2d(width, features, 3, padding=1), nn.LeakyReLU()]
        for _ in range(factor.bit_length() - 1):
            stages += [nn.Conv2d(features, 4 * features, 3, padding=1), nn.PixelShuffle(2)]
        self.upsampling = nn.Sequential(*stages, nn.Conv2d(features, 1, 3, padding=1))

    def forward(self, images: Tensor) -> Tensor:
        """Not limited to [0,1]."""
        shallow = self.shallow(images[:, None])
        deep = self.norm(self.deep(shallow).permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        return self.upsampling(shallow + self.joined(deep))[:, 0]
