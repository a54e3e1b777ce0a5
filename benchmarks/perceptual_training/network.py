"""The network while it learns: batch normalisation between its layers, heads on top, channel weights to be found."""

from __future__ import annotations

from functools import reduce
from operator import add

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from fractal_exp.perceptual import fractal_features
from fractal_exp.perceptual.feature_distance import squared_distance, unit_length
from fractal_exp.perceptual.fractal_features import CHANNELS

EMBEDDING = 64
FIRST_WEIGHT = 0.0    # of a channel, before softplus
FLOOR = 1e-6          # of a distance: two pictures of one code differ by more
TEMPERATURE = 0.25    # of the margin between two logarithms
LEAST_APART = 0.1     # of two logarithms of sizes


class Learner(nn.Module):
    """`fractal_features.network` with batch normalisation before each ReLU, channel weights kept non-negative by
    softplus, a linear classifier of `classes` codes (none if 0) and a projection for contrastive pairs, both on the
    mean over the pixels of the deepest level. Initial weights are drawn from the generator, nothing from the global
    one."""

    def __init__(self, classes: int, generator: torch.Generator):
        super().__init__()
        layers = fractal_features.network().to_empty(device="cpu")
        self.convolutions = nn.ModuleList(layer for layer in layers if isinstance(layer, nn.Conv2d))
        self.norms = nn.ModuleList(nn.BatchNorm2d(count) for count in CHANNELS)
        self.raw_weights = nn.ParameterList(torch.full((count,), FIRST_WEIGHT) for count in CHANNELS)
        self.projection = nn.utils.skip_init(nn.Linear, CHANNELS[-1], EMBEDDING)
        self.classifier = nn.utils.skip_init(nn.Linear, CHANNELS[-1], classes) if classes else None
        for module in self.modules():
            if isinstance(module, (nn.Conv2d, nn.Linear)):
                fan_in = module.weight[0].numel()
                with torch.no_grad():
                    module.weight.copy_(torch.randn(module.weight.shape, generator=generator) * (2 / fan_in) ** 0.5)
                    module.bias.zero_()

    def features(self, images: Tensor) -> list[Tensor]:
        """The levels (B,C,h,w), after their ReLUs, of images (B,R,R)."""
        x, found = images[:, None], []
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            x = F.relu(norm(convolution(x)))
            found.append(x)
        return found

    def weights(self) -> list[Tensor]:
        """The channel weights (C,) of each level, above 0."""
        return [F.softplus(raw) for raw in self.raw_weights]

    def distances(self, copies: list[Tensor], truth: list[Tensor]) -> Tensor:
        """(T,K) from `unit` features (T,K,C,h,w) and (T,C,h,w); see `perceptual.PerceptualDistance`."""
        levels = zip(copies, truth, self.weights(), strict=True)
        return reduce(add, (squared_distance(a, b[:, None], weight) for a, b, weight in levels))

    def export(self, scale: float) -> tuple[nn.Sequential, list[Tensor]]:
        """The bare network, batch normalisation folded into its convolutions, and the channel weights times `scale`."""
        layers = fractal_features.network().to_empty(device="cpu")
        bare = [layer for layer in layers if isinstance(layer, nn.Conv2d)]
        with torch.no_grad():
            for layer, convolution, norm in zip(bare, self.convolutions, self.norms, strict=True):
                gain = norm.weight / (norm.running_var + norm.eps).sqrt()
                layer.weight.copy_(convolution.weight * gain[:, None, None, None])
                layer.bias.copy_((convolution.bias - norm.running_mean) * gain + norm.bias)
        return layers, [scale * weight.detach().cpu() for weight in self.weights()]


def unit(features: list[Tensor]) -> list[Tensor]:
    """Every level scaled to unit length at every pixel."""
    return [unit_length(level) for level in features]


def ranking_loss(distances: Tensor, sizes: Tensor, smallest: float, largest: float) -> Tensor:
    """RankNet on the logarithms of distances (T,K): every pair of copies, of one truth or of two, whose displacements
    `sizes` (T,K) differ by more than a tenth is to be in their order (Burges et al. 2005). Sizes count as at least
    `smallest` and at most `largest`: nothing is asked of the order of what cannot be seen, or is lost in any case.
    """
    order = sizes.clamp(smallest, largest).log()
    score = (distances + FLOOR).log()

    def loss(order: Tensor, score: Tensor) -> Tensor:
        apart = order[..., :, None] - order[..., None, :]
        margin = (score[..., :, None] - score[..., None, :]) / TEMPERATURE
        wrong = F.softplus(-margin)[apart > LEAST_APART]
        return wrong.mean() if len(wrong) else score.sum() * 0

    return 0.5 * loss(order, score) + 0.5 * loss(order.flatten(), score.flatten())


def contrastive_loss(a: Tensor, b: Tensor, temperature: float = 0.1) -> Tensor:
    """InfoNCE of embeddings (T,E) and (T,E) of two pictures of each of T codes (van den Oord et al. 2018)."""
    similarity = F.normalize(a, dim=1) @ F.normalize(b, dim=1).T / temperature
    same = torch.arange(len(a), device=a.device)
    return 0.5 * (F.cross_entropy(similarity, same) + F.cross_entropy(similarity.T, same))
