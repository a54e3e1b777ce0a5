"""The loop that trains the network of the distance `fractal`, from a recipe to layers and channel weights."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError
from ..methods.base import OnStep, Progress, check_device
from ..perceptual.fractal_features import SMALLEST_PX
from ..runtime.checkpoint import Checkpoint, Snapshot
from ..runtime.seeds import derive, generator
from .network import Learner, contrastive_loss, ranking_loss, unit
from .paths import fit_path
from .perturbations import Maps
from .pictures import Batch, Path, batch, random_code
from .scores import spearman

TRAINING, VALIDATION = "perceptual-training", "perceptual-validation"  # streams of seeds; suites have plain numbers
CODES_AT_64, SMALLEST_BATCH = 16, 3
SMALLEST_SIZE, LARGEST_SIZE = 1e-3, 0.5   # displacements in units of the canvas that are told apart in training
VALIDATION_RESOLUTIONS, VALIDATION_CODES = (64, 128), 24
UNRELATED = 0.5  # the mean distance of pictures of two codes that have nothing to do with each other
WARM_UP = 100    # steps in which the learning rate rises


@dataclass(frozen=True)
class Recipe:
    """What a training does; kept whole in the file that it writes.

    steps: of the network; calibration: more steps, in which only the channel weights learn; classes: how many codes it
    sees (0: as many as it takes; their numbers follow from the step and the size of its batch, which the resolution
    decides, so that about one code in seven comes back, with other pictures); copies: of each, moved by known amounts;
    resolutions: of the pictures, with the chance of each; classification, contrastive, ranking: weights of the three
    losses; learning_rate: of AdamW, after a warm-up falling to 0 as a cosine; weight_decay; fine: the share of batches
    of 64² pictures (of larger ones fewer, as they take longer) that are drawn with all the points of a target; fits:
    how many real fits' paths take part, path_chance: the share of batches that are drawn from them; seed. Raises
    `InputError` on values out of range.
    """

    steps: int = 12_000
    calibration: int = 300
    classes: int = 0
    copies: int = 5
    resolutions: Sequence[int] = (64, 128, 256)
    resolution_chances: Sequence[float] = (0.35, 0.35, 0.3)
    batch: int = CODES_AT_64
    classification: float = 0.0
    contrastive: float = 0.0
    ranking: float = 1.0
    learning_rate: float = 3e-3
    weight_decay: float = 1e-4
    fine: float = 0.3
    fits: int = 100
    path_chance: float = 0.2
    validate_every: int = 500
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("resolutions", "resolution_chances"):
            object.__setattr__(self, name, tuple(getattr(self, name)))
        least = {"steps": 1, "calibration": 1, "classes": 0, "copies": 2, "batch": 2, "fits": 0, "validate_every": 1}
        for name, low in least.items():
            if getattr(self, name) < low:
                raise InputError(f"{name} must be at least {low}, got {getattr(self, name)}")
        if len(self.resolutions) != len(self.resolution_chances) or not self.resolutions:
            raise InputError(f"every resolution needs a chance, got {len(self.resolutions)} and "
                             f"{len(self.resolution_chances)}")
        if min(self.resolutions) < SMALLEST_PX:
            raise InputError(f"resolutions must be at least 32, the network's smallest image, got {self.resolutions}")
        if min(self.resolution_chances) < 0 or not sum(self.resolution_chances) > 0:
            raise InputError(f"probabilities must not be negative nor all 0, got {self.resolution_chances}")
        for name in ("classification", "contrastive", "ranking", "weight_decay", "path_chance", "fine"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise InputError(f"{name} must be a finite number of at least 0, got {value}")
        if not self.classification + self.contrastive + self.ranking > 0:
            raise InputError("there is nothing to learn: give classification, contrastive or ranking a weight above 0")
        if self.classification and not self.classes:
            raise InputError("classification needs classes of at least 1, got 0")
        if not self.learning_rate > 0:
            raise InputError(f"learning_rate must be above 0, got {self.learning_rate}")

    @property
    def total(self) -> int:
        """All steps."""
        return self.steps + self.calibration


@dataclass(frozen=True)
class Trained:
    """What `fractal_features.save` keeps, and the Spearman correlations on the validation pictures."""

    layers: nn.Sequential
    channel_weights: list[Tensor]
    scores: dict[str, float]
    recipe: dict[str, Any]


def train(recipe: Recipe, *, device: str = "cpu", on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
          ) -> Trained:
    """Train a network as the recipe says. Every batch depends on the recipe's seed and its number alone.

    The same recipe gives the same file on one machine with one number of threads, also if it was interrupted and
    resumed from its checkpoint. Raises `InputError` on a device that there is not, or a checkpoint that does not fit.
    """
    check_device(device)
    learner = Learner(recipe.classes if recipe.classification else 0, generator(recipe.seed, TRAINING, "initial"))
    learner.to(device).to(memory_format=torch.channels_last)
    optimizer = torch.optim.AdamW(learner.parameters(), recipe.learning_rate, weight_decay=recipe.weight_decay)
    first = _resume(learner, optimizer, checkpoint)
    validation = [_validation(recipe, resolution) for resolution in VALIDATION_RESOLUTIONS]
    source = Source(recipe)
    scores: dict[str, float] = {}
    for step, drawn in source.batches(first, ahead=device != "cpu"):
        if checkpoint and step > first and step % checkpoint.every == 0:
            checkpoint.save(_snapshot(learner, optimizer, step))
        for group in optimizer.param_groups:
            group["lr"] = learning_rate(recipe, step)
        losses = _losses(learner.train(step < recipe.steps), drawn.to(device), recipe, step >= recipe.steps)
        optimizer.zero_grad()
        losses["loss"].backward()
        optimizer.step()
        scalars = {name: float(value.detach()) for name, value in losses.items()}
        done = step + 1
        if done % recipe.validate_every == 0 or done in (recipe.steps, recipe.total):
            scores = validate(learner, validation, device)
            scalars |= scores
        if on_step:
            on_step(Progress(done, done / recipe.total, scalars, stage=_stage(recipe, step)))
    layers, weights = learner.export(UNRELATED / _unrelated(learner, validation, device))
    return Trained(layers, weights, scores, asdict(recipe))


def _stage(recipe: Recipe, step: int) -> str:
    return "network" if step < recipe.steps else "calibration"


def learning_rate(recipe: Recipe, step: int) -> float:
    """A warm-up, then a cosine to 0 over the steps of the network, and another one over those of the calibration."""
    begin, length = (0, recipe.steps) if step < recipe.steps else (recipe.steps, recipe.calibration)
    factor = 1.0 if begin == 0 else 5.0  # weights of channels alone bear larger steps
    cosine = 0.5 * (1 + math.cos(math.pi * (step - begin) / length))
    return factor * recipe.learning_rate * min(1.0, (step - begin + 1) / min(WARM_UP, length)) * cosine


class Source:
    """The batches of a recipe, drawn by the CPU; `ahead`, one in the background while a GPU works on the last."""

    def __init__(self, recipe: Recipe):
        self.recipe = recipe
        self._code = lru_cache(recipe.classes or 1)(self._draw_code)

    def batches(self, first: int, ahead: bool) -> Iterator[tuple[int, Batch]]:
        steps = range(first, self.recipe.total)
        if not ahead:
            yield from ((step, self.batch(step)) for step in steps)
            return
        with ThreadPoolExecutor(1) as pool:
            waiting = pool.submit(self.batch, first)
            for step in steps:
                drawn, waiting = waiting.result(), pool.submit(self.batch, min(step + 1, self.recipe.total - 1))
                yield step, drawn

    def batch(self, step: int) -> Batch:
        """The batch of a step: of random codes and their copies, or of paths of fits."""
        recipe = self.recipe
        rng = np.random.Generator(np.random.PCG64(derive(recipe.seed, TRAINING, "batch", step)))
        p = np.array(recipe.resolution_chances) / sum(recipe.resolution_chances)
        resolution = int(rng.choice(recipe.resolutions, p=p))
        count, fine = max(SMALLEST_BATCH, recipe.batch * 64 // resolution), rng.random() < recipe.fine * 64 / resolution
        if recipe.fits and rng.random() < recipe.path_chance:
            picked = [int(k) for k in rng.choice(recipe.fits, min(count, recipe.fits), replace=False)]
            paths = [self.path(k) for k in picked]
            return batch([path.truth for path in paths], [-1] * len(paths), recipe.copies, resolution,
                         derive(recipe.seed, TRAINING, "pictures", step), paths, fine)
        numbers = (rng.choice(recipe.classes, count, replace=recipe.classes < count) if recipe.classes
                   else step * count + np.arange(count))
        return batch([self._code(int(k)) for k in numbers], [int(k) for k in numbers], recipe.copies, resolution,
                     derive(recipe.seed, TRAINING, "pictures", step), fine=fine)

    def _draw_code(self, number: int) -> Maps:
        return random_code(derive(self.recipe.seed, TRAINING, "code", number))

    @lru_cache(None)  # noqa: B019 — lives as long as the training
    def path(self, number: int) -> Path:
        """The path of fit `number`, which takes about half a second."""
        return fit_path(derive(self.recipe.seed, TRAINING, "fit", number))


def _losses(learner: Learner, drawn: Batch, recipe: Recipe, calibrating: bool) -> dict[str, Tensor]:
    """The losses by name and their weighted sum; in the calibration the ranking of the distance alone."""
    codes, copies, side, _ = drawn.copies.shape
    pairs = recipe.ranking > 0 or calibrating
    others = not calibrating and recipe.classification + recipe.contrastive > 0
    images = [drawn.truth, *([drawn.partner] if others else []), *([drawn.copies.flatten(0, 1)] if pairs else [])]
    with torch.set_grad_enabled(not calibrating):
        features = learner.features(torch.cat(images))
    losses: dict[str, Tensor] = {}
    if pairs:
        levels = unit(features)
        away = learner.distances([x[-codes * copies:].unflatten(0, (codes, copies)) for x in levels],
                                 [x[:codes] for x in levels])
        losses["ranking"] = ranking_loss(away, drawn.sizes, SMALLEST_SIZE * side / 2, LARGEST_SIZE * side / 2)
    if others:
        means = features[-1][:2 * codes].mean((-2, -1))
        if recipe.contrastive:
            embedded = learner.projection(means)
            losses["contrastive"] = contrastive_loss(embedded[:codes], embedded[codes:])
        if recipe.classification and learner.classifier is not None and int(drawn.classes[0]) >= 0:
            losses["classification"] = nn.functional.cross_entropy(learner.classifier(means), drawn.classes.repeat(2))
    weights = {"ranking": 1.0} if calibrating else asdict(recipe)
    # A batch of fits' paths has no classes: where nothing else is learnt it teaches nothing.
    total = sum((weights[name] * value for name, value in losses.items()), features[-1].sum() * 0)
    return {"loss": total, **losses}


def _validation(recipe: Recipe, resolution: int) -> Batch:
    """Pictures of codes that training never sees."""
    codes = [random_code(derive(recipe.seed, VALIDATION, "code", k)) for k in range(VALIDATION_CODES)]
    return batch(codes, [-1] * len(codes), 8, resolution, derive(recipe.seed, VALIDATION, resolution))


@torch.no_grad()
def validate(learner: Learner, batches: list[Batch], device: str) -> dict[str, float]:
    """Spearman's correlation of distance and displacement by resolution: within a code's copies, and over all."""
    learner.eval()
    scores = {}
    for drawn in batches:
        truth = unit(learner.features(drawn.truth.to(device)))
        copies = unit(learner.features(drawn.copies.flatten(0, 1).to(device)))
        away = learner.distances([x.unflatten(0, drawn.sizes.shape) for x in copies], truth).cpu().numpy()
        side = drawn.truth.shape[-1]
        sizes = drawn.sizes.clamp(SMALLEST_SIZE * side / 2, LARGEST_SIZE * side / 2)  # as in training
        within, pooled = spearman(away, sizes.numpy())
        scores |= {f"spearman_within_{side}": float(within.mean()), f"spearman_pooled_{side}": pooled}
    return scores


@torch.no_grad()
def _unrelated(learner: Learner, batches: list[Batch], device: str) -> float:
    """The mean distance of pictures of different codes."""
    learner.eval()
    truth = unit(learner.features(batches[-1].truth.to(device)))
    return float(learner.distances([x.roll(1, 0)[:, None] for x in truth], truth).mean())


def _snapshot(learner: Learner, optimizer: torch.optim.Optimizer, step: int) -> Snapshot:
    tensors = {f"learner/{name}": value for name, value in learner.state_dict().items()}
    for number, state in optimizer.state_dict()["state"].items():
        tensors |= {f"optimizer/{number}/{name}": value for name, value in state.items()}
    return Snapshot(step, tensors)


def _resume(learner: Learner, optimizer: torch.optim.Optimizer, checkpoint: Checkpoint | None) -> int:
    saved = checkpoint.load() if checkpoint else None
    if saved is None:
        return 0
    learner.load_state_dict({name.removeprefix("learner/"): value for name, value in saved.tensors.items()
                             if name.startswith("learner/")})
    state: dict[int, dict[str, Tensor]] = {}
    for name, value in saved.tensors.items():
        if name.startswith("optimizer/"):
            _, number, key = name.split("/")
            state.setdefault(int(number), {})[key] = value
    optimizer.load_state_dict({"state": state, "param_groups": optimizer.state_dict()["param_groups"]})
    return saved.iteration


