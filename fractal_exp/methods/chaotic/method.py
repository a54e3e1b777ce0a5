"""The paper's method: chaos game, splatting and a hybrid optimiser, in one explicit loop."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, NoReturn, Self

import torch
from pydantic import BaseModel, Field, model_validator
from torch import Tensor

from ...errors import InputError
from ...ifs.code import IFS
from ...runtime.checkpoint import Checkpoint, Snapshot, moments, under
from ...runtime.checks import check_choice, check_seconds
from ...runtime.deadline import Deadline
from ...runtime.memory import keep_freed
from ...runtime.precision import full_precision
from ...runtime.seeds import derive, generator
from ..base import (
    AnyTarget,
    CodeReconstruction,
    FitDiverged,
    Method,
    OnStep,
    Progress,
    check_device,
    check_target,
    time_is_up,
)
from .best_states import BestStates
from .losses import DSSIM, MipMSE, Regularizer, WeightedSum, perceptual_term
from .model import SVD, ForwardModel, Parameters
from .optimizers import Alternating, Annealing, Optimizer
from .problem import FitProblem
from .readback import Numbers, Pending, steps_at_a_time

RESULTS = "best", "after_step", "last"   # which state of a fit is its result


class Kept(BaseModel):
    """The numbers of a checkpoint: those of the best states."""

    losses: list[float]
    iterations: list[Annotated[int, Field(ge=0)]]

    @model_validator(mode="after")
    def _are_as_many(self) -> Self:
        if len(self.losses) != len(self.iterations):
            raise ValueError(f"{len(self.losses)} losses of {len(self.iterations)} iterations")
        return self


class Chaotic(Method):
    """Learning Image Fractals Using Chaotic Differentiable Point Splatting (Eurographics 2025).

    model draws, objective judges, optimizer moves; `iterations` of it (15 000 in the paper), the temperature falling
    linearly from 1 to 0. With `seconds`, time may end the run first; the schedule then follows whichever of iterations
    and time is further on (and a run can no longer be repeated bit for bit).

    init: a method whose code, of however many maps, the run begins with instead of random parameters; it is handed the
    same target, and there is one start. The model plays all maps alike, whatever the code's own probabilities.

    starts: with more than one, each start is first followed for `scouting` iterations (without phases of
    annealing), and the run proper goes on from the best state that they met. The paper has one; with few maps, most
    single starts end in a poor local minimum, and a hundred iterations show which.

    result: "best", the best state by total loss: the best `kept` contractive states seen are drawn again with
    `rescoring_draws` fresh sets of points, since the loss that singled them out was a lucky draw as well; "after_step",
    the same of the parameters that the step of a low loss led to, annealing included, in place of those whose loss it
    is, as the released program does, with kept=1; "last", the parameters after the last step, as in the paper's
    appendix.

    match_target: compare with the target as the model itself would draw it (`ForwardModel.match`), which the paper
    does not. radii: of the splats, in units of the model's, each for an equal part of the run; with some above 1 a fit
    goes from coarse to fine, and its best state is one of the last part. previews: how often a run reports a preview
    image and the code of the lowest loss so far, evenly spread over its iterations. device: where tensors live; on a
    GPU the numbers of up to 32 steps are fetched together, and so are they told to `on_step`. Raises `InputError` on
    values out of range.
    """

    def __init__(self, model: ForwardModel, objective: WeightedSum, optimizer: Optimizer, *, iterations: int = 15_000,
                 seconds: float | None = None, seed: int = 0, starts: int = 1, scouting: int = 100, kept: int = 8,
                 rescoring_draws: int = 4, match_target: bool = False, previews: int = 20, device: str = "cpu",
                 init: Method | None = None, radii: Sequence[float] = (1.0,), result: str = "best"):
        counts = {"iterations": iterations, "starts": starts, "scouting": scouting, "kept": kept,
                  "rescoring_draws": rescoring_draws}
        for name, value in counts.items():
            if value < 1:
                raise InputError(f"{name} must be at least 1, got {value}")
        if init is not None and starts > 1:
            raise InputError(f"a fit that begins with the code of another method has one start, got starts={starts}")
        if init is not None and not model.parameterization.takes_codes:
            raise InputError(f"{type(model.parameterization).__name__} does not reach every map, so that a fit cannot "
                             "begin with the code of another method; take model=svd")
        if not radii or not all(radius > 0 for radius in radii):
            raise InputError(f"radii must be one or more numbers above 0, got {list(radii)}")
        if previews < 0:
            raise InputError(f"previews must be at least 0, got {previews}")
        check_choice("result", result, RESULTS)
        check_seconds(seconds)
        self.model, self.objective, self.optimizer = model, objective, optimizer
        self.iterations, self.seconds, self.seed = iterations, seconds, seed
        self.scouted, self.scouting = (starts * scouting if starts > 1 else 0), scouting
        self.kept, self.rescoring_draws, self.previews = kept, rescoring_draws, previews
        self.match_target, self.device, self.init = match_target, check_device(device), init
        self.radii, self.result = tuple(radii), result

    @full_precision()
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None,
                    checkpoint: Checkpoint | None = None) -> CodeReconstruction:
        keep_freed()
        image = check_target(target, self.model.resolution).to(self.device)
        total = self.scouted + self.iterations
        best = BestStates(self.kept, spacing=max(1, self.iterations // 100))
        start_time = time.monotonic()
        first = self._start(best, checkpoint, image)
        preview_every = self._preview_every

        iteration, fraction = first, first / total
        radius = self._radius(fraction * total)
        problem = self._problem(image, radius)
        at_a_time, pending = steps_at_a_time(self.device), Pending()
        while fraction < 1:
            if 0 < iteration <= self.scouted and iteration % self.scouting == 0:
                scouted = iteration == self.scouted
                self.optimizer.start(self._some(best.states)[0] if scouted else self._initial(iteration), self.seed)
            if radius != self._radius(fraction * total):  # losses with another are no measure of this one's
                radius = self._radius(fraction * total)
                problem = self._problem(image, radius)
                best.clear()
            if not pending:
                good = Snapshot(iteration, self._tensors(best), {"losses": best.losses, "iterations": best.iterations})
            if checkpoint and iteration > first and iteration % checkpoint.every == 0:
                checkpoint.save(good)
            scouting = iteration < self.scouted
            temperature = (self.optimizer.scouting_temperature if scouting
                           else (1 - fraction) * total / self.iterations)
            try:
                step = self.optimizer.step(problem, iteration, temperature)
                if self.result == "after_step":
                    step = replace(step, raw={name: raw.detach().clone() for name, raw in self.optimizer.raw.items()})
                iteration += 1
                elapsed = (time.monotonic() - start_time) / self.seconds if self.seconds else 0.0
                fraction = min(1.0, max(iteration / total, elapsed))
                pending.add(step, iteration - 1, fraction, temperature)
                wanted = on_step and preview_every and (iteration % preview_every == 0 or fraction == 1)
                if (len(pending) >= at_a_time or wanted or fraction == 1 or radius != self._radius(fraction * total)
                        or (checkpoint and iteration % checkpoint.every == 0)
                        or (iteration <= self.scouted and iteration % self.scouting == 0)):
                    draw = partial(problem.draw, self.optimizer.raw, self.seed) if wanted else None
                    self._settle(pending, best, good, checkpoint, on_step, draw)
            except KeyboardInterrupt:
                if checkpoint:
                    checkpoint.save(good)
                raise

        raw = self._last() if self.result == "last" else self._best(best, problem)
        is_cut = self.seconds and iteration < total
        stopped = time_is_up(Deadline(self.seconds)) if is_cut else f"all {total} iterations done"
        return CodeReconstruction(self.model.code(raw, derive(self.seed, "frame")).check_contractive(), stopped)

    @torch.no_grad()
    def _best(self, best: BestStates, problem: FitProblem) -> Parameters:
        """The state of the lowest mean loss over new draws."""
        self._some(best.states)
        return best.choose(lambda state, draw: float(problem.loss(state, derive(self.seed, "rescoring", draw))[0]),
                           self.rescoring_draws)

    def _last(self) -> Parameters:
        """The state after the last step. Raises `FitDiverged` if its maps do not contract."""
        raw = self.optimizer.raw
        return self._some([raw] if bool(self.model.is_contractive(raw).all()) else [])[0]

    def _radius(self, iteration: float) -> float:
        """Of the splats at this iteration, or where time has come as far as that."""
        part = max(0.0, iteration - self.scouted) / self.iterations
        return self.radii[min(int(part * len(self.radii)), len(self.radii) - 1)]

    def _problem(self, image: Tensor, radius: float) -> FitProblem:
        model = self.model.with_splats(radius)
        target = model.match(image, derive(self.seed, "match")) if self.match_target else image
        return FitProblem(model, self.objective, target)

    def check(self, target: AnyTarget) -> None:
        self.objective.prepare(check_target(target, self.model.resolution).to(self.device))
        if self.init is not None:
            self.init.check(target)

    @staticmethod
    def _some(states: list[dict[str, Tensor]]) -> list[dict[str, Tensor]]:
        if not states:
            raise FitDiverged("no contractive state was met, so there is no attractor to return; raise the weight of "
                              "the regulariser, or take the SVD parameterisation")
        return states

    def _start(self, best: BestStates, checkpoint: Checkpoint | None, image: Tensor) -> int:
        """Put the optimiser at its first or its saved state and return the iteration to go on with."""
        saved = checkpoint.load() if checkpoint else None
        if saved is None:
            self.optimizer.start(self._initial(0) if self.init is None else self._handed_on(self.init, image),
                                 self.seed)
            return 0
        kept, raw = saved.checked(Kept), self._initial(0)
        expected = {f"raw/{name}": value for name, value in raw.items()}
        if saved.holds("optimizer/"):
            expected |= {f"optimizer/{name}": value for name, value in moments(raw).items()}
        expected |= {f"best/{i}/{name}": value for i in range(len(kept.losses)) for name, value in raw.items()}
        tensors = {name: tensor.to(self.device) for name, tensor in saved.like(expected).items()}
        self.optimizer.start(under("raw/", tensors), self.seed)
        self.optimizer.load_state(under("optimizer/", tensors))
        for i, (loss, iteration) in enumerate(zip(kept.losses, kept.iterations, strict=True)):
            best.offer(loss, iteration, under(f"best/{i}/", tensors))
        return saved.iteration

    def _initial(self, iteration: int) -> dict[str, Tensor]:
        """Random parameters for the start that begins at this iteration."""
        raw = self.model.parameterization.initial(self.model.maps, generator(self.seed, "initial", iteration))
        return {name: value.to(self.device) for name, value in raw.items()}

    def _handed_on(self, init: Method, image: Tensor) -> dict[str, Tensor]:
        """Parameters of the code that the method `init` finds."""
        found = init.reconstruct(image)
        if not isinstance(found, CodeReconstruction):
            raise InputError(f"init must be a method that finds a code, got {type(init).__name__}")
        raw = self.model.encode(found.code)
        return {name: value.to(self.device) for name, value in raw.items()}

    def _tensors(self, best: BestStates) -> dict[str, Tensor]:
        tensors = {f"raw/{name}": value.detach().clone() for name, value in self.optimizer.raw.items()}
        tensors |= {f"optimizer/{name}": value for name, value in self.optimizer.state().items()}
        for i, state in enumerate(best.states):
            tensors |= {f"best/{i}/{name}": value for name, value in state.items()}
        return tensors

    def _settle(self, pending: Pending, best: BestStates, good: Snapshot, checkpoint: Checkpoint | None,
                on_step: OnStep | None, draw: Callable[[], Tensor] | None) -> None:
        """Judge the steps that are pending, in their order, and tell of them; what is drawn is the last one's preview.
        """
        numbers = pending.fetch(self.model, self.optimizer.raw)
        for each in numbers:
            if not each.finite:
                self._break_off(each, good, checkpoint)
            if each.contractive:
                best.offer(each.loss, each.iteration, each.step.raw)
            if on_step:
                step, told = each.iteration + 1, draw is not None and each is numbers[-1]
                on_step(Progress(step, each.fraction, each.scalars(), draw() if draw and told else None,
                                 self._stage(step), self._code_so_far(best) if told else None))

    @property
    def _preview_every(self) -> int | None:
        return math.ceil((self.scouted + self.iterations) / self.previews) if self.previews else None

    def _stage(self, step: int) -> str | None:
        """The name of the stage that a step belongs to, by its first one: a stage ends with a preview."""
        every = self._preview_every
        return None if every is None else f"iterations from {(step - 1) // every * every + 1}"

    def _code_so_far(self, best: BestStates) -> IFS | None:
        return self.model.code(best.states[0], derive(self.seed, "frame")) if best.states else None

    @staticmethod
    def _break_off(failed: Numbers, good: Snapshot, checkpoint: Checkpoint | None) -> NoReturn:
        where = "no checkpoint was asked for"
        if checkpoint:
            checkpoint.save(good)
            where = f"the state before {'it' if good.iteration == failed.iteration else f'iteration {good.iteration}'}"
            where += f" is in {checkpoint.path}"
        terms = ", ".join(f"{name} {value:.4g}" for name, value in failed.terms.items())
        raise FitDiverged(f"iteration {failed.iteration} met a NaN or an infinity (loss {failed.loss:.4g}: {terms});"
                          f" {where}. Try a smaller learning rate or a larger weight of the regulariser")


def laptop(*, resolution: int = 256, maps: int = 10, iterations: int = 800, starts: int = 10, scouting: int = 120,
           trajectories: int = 1000, length: int = 110, match_target: bool = True, perceptual: str | None = None,
           perceptual_weights: str | None = None, seed: int = 0, seconds: float | None = None,
           init: Method | None = None, radii: Sequence[float] = (1.0,)) -> Chaotic:
    """The method at the sizes of the configuration scale=laptop: two cores finish in minutes. With `init` there is one
    start."""
    model = ForwardModel(SVD(), resolution=resolution, maps=maps, trajectories=trajectories, length=length)
    objective = WeightedSum(
        {"mse": 10.0, "ssim": 1.0, "perceptual": 2.0, "regularizer": 0.01},
        {"mse": MipMSE(), "ssim": DSSIM(), "perceptual": perceptual_term(perceptual or "none", perceptual_weights),
         "regularizer": Regularizer()})
    optimizer = Alternating(every=100, annealing=Annealing(sharpness=1000.0))
    return Chaotic(model, objective, optimizer, iterations=iterations, seconds=seconds, seed=seed,
                   starts=1 if init else starts, scouting=scouting, match_target=match_target, init=init,
                   radii=radii)
