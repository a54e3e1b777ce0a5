"""Learning Fractals: gradient descent on the squared error of sparse random sequences.

Source: Tu et al., "Learning Fractals by Gradient Descent", AAAI 2023, on its own canvas of 32² and, as "Learning Image
Fractals" (Eurographics 2025, section 5.1) did, on 256².
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

import torch
from pydantic import Field
from torch import Tensor
from torch.nn.utils import clip_grad_norm_

from ...ifs.code import IFS
from ...ops.sequences import blob_error, sequence
from ...runtime.checkpoint import under
from ...runtime.params import Amount, Params, Positive
from ...runtime.seeds import derive, generator
from ..base import resized
from ..stepwise import SMALLEST_INPUT, State, Stepwise, Walk, check_resolution
from . import maps as affine

MOMENTS = ("exp_avg", "exp_avg_sq")  # of Adam


class LearningFractalsParams(Params):
    """The parameters of Learning Fractals; those that the two canvases differ in are of 32²."""

    maps: Annotated[int, Field(ge=1, le=64)] = 10
    """Number of maps of the code (10 in the paper's comparison)."""
    iterations: Positive = 3000
    """Steps of Adam (3000 in the comparison)."""
    side: Annotated[int, Field(ge=SMALLEST_INPUT, le=1024)] = 32
    """Pixels a side of the method's canvas; the image is brought to it (32 by Tu et al.; 256 in the paper)."""
    points: Positive = 300
    """Points of a sequence (300 by Tu et al.; 600 in the paper at 256²)."""
    sequences: Positive = 50
    """Sequences of each iteration, each drawn as an image of its own (Tu et al.: 50)."""
    rate: Amount = 0.05
    """Learning rate of Adam at first; it is halved after each quarter of the iterations (Tu et al.: 0.05)."""
    largest_gradient: Annotated[float, Field(gt=0, allow_inf_nan=False)] = 1.0
    """Norm to which the gradient is clipped, that of the matrices' numbers and that of the offsets each by itself."""
    noise: Amount = 0.1
    """Standard deviation of what is added to the matrices' numbers now and then (Tu et al.: 0.1)."""
    noise_every: Positive = 10
    """Iterations from one addition of noise to the next (Tu et al.: 10)."""
    noise_until: Annotated[int, Field(ge=0)] = 600
    """Iteration from which there is no more noise (Tu et al.: 600)."""
    as_released: bool = False
    """Whether the result is the last state, as in the paper's evaluation, and not the best one."""


class LearningFractals256Params(LearningFractalsParams):
    """The parameters on the larger canvas."""

    side: Annotated[int, Field(ge=SMALLEST_INPUT, le=1024)] = 256
    """Pixels a side of the method's canvas; the image is brought to it (32 by Tu et al.; 256 in the paper)."""
    points: Positive = 600
    """Points of a sequence (300 by Tu et al.; 600 in the paper at 256²)."""


def learning_rate(iteration: int, params: LearningFractalsParams) -> float:
    """Of this iteration: halved at each quarter of the budget."""
    return params.rate * 0.5 ** (4 * iteration // params.iterations)


class LearningFractalsWalk(Walk):
    """Learning Fractals on one image. What is lowered is the mean squared error of an iteration's sequences."""

    def __init__(self, image: Tensor, params: LearningFractalsParams, seed: int):
        check_resolution(len(image))
        super().__init__(resized(image, params.side), params, seed)

    def start(self) -> State:
        raw = affine.initial(self.params.maps, generator(self.seed, "initial"))
        raw = {name: value.to(self.image.device) for name, value in raw.items()}
        empty = {f"{moment}/{name}": torch.zeros_like(value) for moment in MOMENTS for name, value in raw.items()}
        return {**_named("raw/", raw), **empty, **_named("best/", raw),
                "least": torch.full((), torch.inf, device=self.image.device)}

    def step(self, state: State, number: int) -> State:
        raw = {name: value.clone().requires_grad_() for name, value in under("raw/", state).items()}
        loss = self.error(raw, derive(self.seed, "sequences", number)).mean()
        loss.backward()
        clip_gradients(raw, self.params.largest_gradient)
        moments = self._adam(state, raw, number)
        value, least = loss.detach(), state["least"]
        better = bool(value < least)
        best = under("raw/" if better else "best/", state)  # the state that was drawn, not the one after it
        moved = {name: tensor.detach() for name, tensor in raw.items()}
        self._shake(moved, number)
        return {**_named("raw/", moved), **moments, **_named("best/", best), "least": value if better else least}

    def error(self, raw: Mapping[str, Tensor], seed: int) -> Tensor:
        """The squared error of each sequence (B,) that the seed draws."""
        linear = affine.matrices(raw)
        points = sequence(linear, raw["b"], affine.fixed_point(linear[0], raw["b"][0]),
                          sequences=self.params.sequences, length=self.params.points,
                          probabilities=affine.probabilities(linear), seed=seed)
        return blob_error(affine.to_pixels(points, len(self.image)), self.image)

    def _adam(self, state: State, raw: Mapping[str, Tensor], number: int) -> dict[str, Tensor]:
        """One step of Adam on the raw numbers, from the moments of the state; the new moments."""
        adam = torch.optim.Adam(raw.values(), lr=learning_rate(number, self.params))
        for name, tensor in raw.items():
            adam.state[tensor] = {"step": torch.tensor(float(number))} | {
                moment: state[f"{moment}/{name}"].clone() for moment in MOMENTS}
        adam.step()
        return {f"{moment}/{name}": adam.state[tensor][moment] for moment in MOMENTS for name, tensor in raw.items()}

    def _shake(self, raw: dict[str, Tensor], number: int) -> None:
        """Add noise to what the matrices are made of, if it is this iteration's turn."""
        if number % self.params.noise_every or number >= self.params.noise_until:
            return
        random = generator(self.seed, "noise", number)
        for name in affine.MATRIX:
            noise = self.params.noise * torch.randn(raw[name].shape, generator=random)
            raw[name] = raw[name] + noise.to(raw[name].device)

    def evaluations(self, steps: int) -> int:
        return self.params.sequences * steps

    def loss(self, state: State) -> float:
        return float(state["least"])

    def code(self, state: State) -> IFS:
        return affine.code(self._result(state), len(self.image))

    def _result(self, state: State) -> dict[str, Tensor]:
        """The numbers of the code that is the result if this state is the last."""
        return under("raw/" if self.params.as_released else "best/", state)

    @torch.no_grad()
    def draw(self, state: State) -> Tensor:
        raw = self._result(state)
        linear, offset = affine.matrices(raw), raw["b"]
        points = sequence(linear, offset, affine.fixed_point(linear[0], offset[0]), sequences=1,
                          length=20 * self.params.points, probabilities=affine.probabilities(linear), seed=self.seed)
        row, column = affine.to_pixels(points[0], len(self.image)).round().long().unbind(-1)
        drawn = torch.zeros_like(self.image)
        drawn[row, column] = 1
        return drawn


def clip_gradients(raw: Mapping[str, Tensor], largest: float) -> None:
    """Bring the norm of the gradient of all that matrices are made of to `largest` at most, and that of b."""
    clip_grad_norm_([raw[name] for name in affine.MATRIX], largest)
    clip_grad_norm_([raw["b"]], largest)


def _named(prefix: str, raw: Mapping[str, Tensor]) -> dict[str, Tensor]:
    return {f"{prefix}{name}": value.clone() for name, value in raw.items()}


class LearningFractals32(Stepwise):
    """Learning Fractals on its own canvas of 32² (Tu et al. 2023)."""

    unit = "iterations"
    budget = 3000  # as published: a minute or so of one core
    Params, walk = LearningFractalsParams, LearningFractalsWalk
    params: LearningFractalsParams


class LearningFractals256(LearningFractals32):
    """Learning Fractals on 256² with twice the points, as the paper compared with it."""

    Params = LearningFractals256Params
    params: LearningFractals256Params
