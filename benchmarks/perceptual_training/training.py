"""The task of the network behind the distance `fractal`, for the loop of the package: from a recipe to layers and
channel weights."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated

import numpy as np
import torch
from pydantic import Field, model_validator
from torch import Tensor, nn

from fractal_exp.errors import InputError
from fractal_exp.perceptual.fractal_features import SMALLEST_PX
from fractal_exp.runtime.params import Amount, Count, Positive
from fractal_exp.runtime.seeds import derive, generator
from fractal_exp.training.codes import Maps
from fractal_exp.training.loop import Batch, Recipe, Training

from .network import Learner, contrastive_loss, ranking_loss, unit
from .paths import fit_path
from .pictures import Path, Pictures, batch, random_code
from .scores import spearman

TRAINING, VALIDATION = "perceptual-training", "perceptual-validation"  # streams of seeds; suites have plain numbers
SMALLEST_BATCH = 3
SMALLEST_SIZE, LARGEST_SIZE = 1e-3, 0.5   # displacements in units of the canvas that are told apart in training
VALIDATION_RESOLUTIONS = (64, 128)
UNRELATED = 0.5  # the mean distance of pictures of two codes that have nothing to do with each other
WARM_UP = 100    # steps in which the learning rate rises


class PerceptualRecipe(Recipe):
    """How the network is trained; kept whole in the file that comes of it."""

    steps: Positive = 12_000
    """Steps of the network,"""
    calibration: Positive = 300
    """and more in which the channel weights alone learn."""
    batch: Annotated[int, Field(ge=2)] = 16
    """Codes in a batch of 64² pictures; of larger pictures fewer."""
    copies: Annotated[int, Field(ge=2)] = 5
    """Copies of each code, moved by known amounts."""
    classes: Count = 0
    """Codes in all; 0: as many as it takes. Their numbers follow from the step and the size of its batch, which the
    resolution decides, so that about one code in seven comes back, with other pictures."""
    resolutions: tuple[Annotated[int, Field(ge=SMALLEST_PX)], ...] = (64, 128, 256)
    """Pixels a side of the pictures,"""
    resolution_chances: tuple[Amount, ...] = (0.35, 0.35, 0.3)
    """and the chance of each."""
    ranking: Amount = 1.0
    """Weight of the loss that wants distances in the order of the displacements,"""
    contrastive: Amount = 0.0
    """of that which tells two pictures of one code from those of others (InfoNCE),"""
    classification: Amount = 0.0
    """and of that which tells the code from its picture."""
    rate: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 3e-3
    """Learning rate of AdamW; after a warm-up it falls to 0 as a cosine."""
    weight_decay: Amount = 1e-4
    """Weight decay of AdamW."""
    fine: Amount = 0.3
    """Share of the batches of 64² pictures, and of larger ones fewer, that are drawn with all the points of a
    target."""
    fits: Count = 150
    """Real fits whose paths take part,"""
    path_chance: Amount = 0.2
    """in this share of the batches."""
    every: Positive = 250
    """Steps from one look at the held-out codes to the next."""
    held_out: Annotated[int, Field(ge=2)] = 24
    """Codes that are held out."""

    @model_validator(mode="after")
    def _can_be_trained(self) -> PerceptualRecipe:
        if len(self.resolutions) != len(self.resolution_chances) or not sum(self.resolution_chances) > 0:
            raise InputError("every resolution needs a chance, and one of them must be above 0, got "
                             f"{self.resolutions} and {self.resolution_chances}")
        if not self.classification + self.contrastive + self.ranking > 0:
            raise InputError("there is nothing to learn: give classification, contrastive or ranking a weight above 0")
        if self.classification and not self.classes:
            raise InputError("classification needs classes of at least 1, got 0")
        return self


class PerceptualTraining(Training):
    """The training of the network and, behind it, the calibration of its channel weights. The score is what Spearman's
    correlation of distance and displacement lacks of 1."""

    Params = PerceptualRecipe
    params: PerceptualRecipe

    @property
    def steps(self) -> int:
        return self.params.steps + self.params.calibration

    @property
    def every(self) -> int:
        return self.params.every

    @property
    def keeps_best(self) -> bool:
        return False

    def network(self) -> Learner:
        classes = self.params.classes if self.params.classification else 0
        return Learner(classes, generator(self.seed, TRAINING, "initial")).to(memory_format=torch.channels_last)

    def optimizer(self, network: nn.Module) -> torch.optim.Optimizer:
        return torch.optim.AdamW(network.parameters(), self.params.rate, weight_decay=self.params.weight_decay)

    def rate(self, step: int) -> float:
        """A warm-up, then a cosine to 0 over the steps of the network; the same again for the calibration."""
        recipe = self.params
        begin, length = (0, recipe.steps) if step < recipe.steps else (recipe.steps, recipe.calibration)
        factor = 1.0 if begin == 0 else 5.0  # weights of channels alone bear larger steps
        cosine = 0.5 * (1 + math.cos(math.pi * (step - begin) / length))
        return factor * recipe.rate * min(1.0, (step - begin + 1) / min(WARM_UP, length)) * cosine

    def batch(self, step: int) -> Batch:
        """Random codes and their copies, or paths of fits; at the end whether the channel weights alone learn."""
        return *self._pictures(step), torch.tensor(step >= self.params.steps)

    def loss(self, network: nn.Module, batch: Batch) -> Tensor:
        """The weighted sum of the losses; in the calibration the ranking of the distance alone."""
        assert isinstance(network, Learner)
        drawn, calibrating, recipe = Pictures(*batch[:-1]), bool(batch[-1]), self.params
        network.train(not calibrating)
        codes, copies, side, _ = drawn.copies.shape
        pairs = recipe.ranking > 0 or calibrating
        others = not calibrating and recipe.classification + recipe.contrastive > 0
        images = [drawn.truth, *([drawn.partner] if others else []),
                  *([drawn.copies.flatten(0, 1)] if pairs else [])]
        with torch.set_grad_enabled(not calibrating):
            features = network.features(torch.cat(images))
        # A batch of fits' paths has no classes: where nothing else is learnt it teaches nothing.
        total = features[-1].sum() * 0
        if pairs:
            levels = unit(features)
            away = network.distances([x[-codes * copies:].unflatten(0, (codes, copies)) for x in levels],
                                     [x[:codes] for x in levels])
            weight = 1.0 if calibrating else recipe.ranking
            total = total + weight * ranking_loss(away, drawn.sizes, SMALLEST_SIZE * side / 2, LARGEST_SIZE * side / 2)
        if others:
            means = features[-1][:2 * codes].mean((-2, -1))
            if recipe.contrastive:
                embedded = network.projection(means)
                total = total + recipe.contrastive * contrastive_loss(embedded[:codes], embedded[codes:])
            if network.classifier is not None and int(drawn.classes[0]) >= 0:
                found = nn.functional.cross_entropy(network.classifier(means), drawn.classes.repeat(2))
                total = total + recipe.classification * found
        return total

    def judge(self, network: nn.Module, device: str) -> dict[str, float]:
        """Spearman's correlation of distance and displacement by resolution: within a code's copies, and over all."""
        assert isinstance(network, Learner)
        scores = {}
        for side in VALIDATION_RESOLUTIONS:
            drawn = self._held_out(side)
            truth = unit(network.features(drawn.truth.to(device)))
            copies = unit(network.features(drawn.copies.flatten(0, 1).to(device)))
            away = network.distances([x.unflatten(0, drawn.sizes.shape) for x in copies], truth).cpu().numpy()
            sizes = drawn.sizes.clamp(SMALLEST_SIZE * side / 2, LARGEST_SIZE * side / 2)  # as in training
            within, pooled = spearman(away, sizes.numpy())
            scores |= {f"spearman_within_{side}": float(within.mean()), f"spearman_pooled_{side}": pooled}
        return {"held_out": 1 - sum(scores.values()) / len(scores), **scores}

    @torch.no_grad()
    def exported(self, tensors: dict[str, Tensor]) -> tuple[nn.Sequential, list[Tensor]]:
        """The bare layers and channel weights of a trained network, scaled so that pictures of different codes are at
        a mean distance of `UNRELATED`."""
        network = self.network().eval()
        network.load_state_dict(tensors)
        truth = unit(network.features(self._held_out(VALIDATION_RESOLUTIONS[-1]).truth))
        apart = float(network.distances([x.roll(1, 0)[:, None] for x in truth], truth).mean())
        return network.export(UNRELATED / apart)

    def _pictures(self, step: int) -> Pictures:
        recipe = self.params
        rng = np.random.Generator(np.random.PCG64(derive(self.seed, TRAINING, "batch", step)))
        p = np.array(recipe.resolution_chances) / sum(recipe.resolution_chances)
        resolution = int(rng.choice(recipe.resolutions, p=p))
        count, fine = max(SMALLEST_BATCH, recipe.batch * 64 // resolution), rng.random() < recipe.fine * 64 / resolution
        seed = derive(self.seed, TRAINING, "pictures", step)
        if recipe.fits and rng.random() < recipe.path_chance:
            picked = rng.choice(recipe.fits, min(count, recipe.fits), replace=False)
            paths = [self._path(int(k)) for k in picked]
            return batch([path.truth for path in paths], [-1] * len(paths), recipe.copies, resolution, seed, paths,
                         fine)
        numbers = (rng.choice(recipe.classes, count, replace=recipe.classes < count) if recipe.classes
                   else step * count + np.arange(count))
        return batch([self._code(int(k)) for k in numbers], [int(k) for k in numbers], recipe.copies, resolution, seed,
                     fine=fine)

    @lru_cache(None)  # noqa: B019 — lives as long as the training
    def _held_out(self, resolution: int) -> Pictures:
        """Pictures of codes that training never sees."""
        codes = [random_code(derive(self.seed, VALIDATION, "code", k)) for k in range(self.params.held_out)]
        return batch(codes, [-1] * len(codes), 8, resolution, derive(self.seed, VALIDATION, resolution))

    def _code(self, number: int) -> Maps:
        return random_code(derive(self.seed, TRAINING, "code", number))

    @lru_cache(None)  # noqa: B019 — lives as long as the training
    def _path(self, number: int) -> Path:
        """The path of a fit, which takes about half a second."""
        return fit_path(derive(self.seed, TRAINING, "fit", number))
