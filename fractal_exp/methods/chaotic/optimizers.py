"""Gradient descent, simulated annealing and their alternation (Section 4.3 and Algorithm 1 of the paper)."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from ...errors import InputError
from ...runtime.seeds import derive, generator
from .cuda_graph import Recorded
from .model import Parameterization, Parameters
from .problem import FitProblem


@dataclass(frozen=True)
class Step:
    """What one iteration scored: a copy by value of the parameters, their loss and its terms, and, where annealing
    ran, the fraction of its candidates that were accepted."""

    raw: dict[str, Tensor]
    loss: Tensor
    terms: Mapping[str, Tensor]
    accepted: float | None = None


class Optimizer(ABC):
    """Moves raw parameters one iteration at a time; holds them in `raw`.

    Every random number comes from (seed, iteration), so parameters, `state` and the iteration count are all that is
    needed to continue.
    """

    raw: dict[str, Tensor]
    scouting_temperature = 0.0  # while one of several starts is followed: gradients need none

    def start(self, raw: Parameters, seed: int) -> None:
        """Begin at copies of these parameters."""
        self.seed = seed
        # By name, since random numbers are dealt out in this order and a checkpoint does not keep another.
        self.raw = {name: value.detach().clone().requires_grad_() for name, value in sorted(raw.items())}

    @abstractmethod
    def step(self, problem: FitProblem, iteration: int, temperature: float) -> Step:
        """One iteration at this temperature, which falls linearly from 1 to 0 over the run."""

    def state(self) -> dict[str, Tensor]:
        """Everything beside `raw` that the next step depends on, as copies."""
        return {}

    def load_state(self, state: Mapping[str, Tensor]) -> None:  # noqa: B027 - most have nothing to take up
        """Take up a `state`, after `start`."""

    @torch.no_grad()
    def _move_to(self, raw: Parameters) -> None:
        for name, value in raw.items():
            self.raw[name].copy_(value)

    def _copy(self) -> dict[str, Tensor]:
        return {name: value.detach().clone() for name, value in self.raw.items()}


class GradientDescent(Optimizer):
    """Adam at a fixed learning rate with default betas, projected after every step: w/o simulated annealing.

    cuda_graph: on a GPU, record a step once and replay it, unless the problem waits.
    """

    recordable = True  # whether a step depends on the parameters, Adam's moments and one seed alone
    recorder: type[Recorded] = Recorded

    def __init__(self, *, lr: float = 1e-2, cuda_graph: bool = True):
        if not lr > 0:
            raise InputError(f"the learning rate must be above 0, got {lr}")
        self.lr, self.cuda_graph = lr, cuda_graph

    def start(self, raw: Parameters, seed: int) -> None:
        super().start(raw, seed)
        self._recorded: tuple[FitProblem, Recorded] | None = None
        self.reset_moments()

    def reset_moments(self) -> None:
        """Forget Adam's moments."""
        if self._recorded:  # a recording knows them by their place in memory
            for moments in self.adam.state.values():
                for value in moments.values():
                    value.zero_()
            return
        on_gpu = self._device.type == "cuda"
        self.adam = torch.optim.Adam(list(self.raw.values()), lr=self.lr, capturable=on_gpu)
        self.adam._warned_capturable_if_run_uncaptured = True  # it is, in the first steps and where nothing is recorded

    def step(self, problem: FitProblem, iteration: int, temperature: float) -> Step:
        seed = derive(self.seed, "gradient", iteration)
        if self.records(problem):
            return self._replay(problem, seed)
        scored = self._copy()
        loss, terms = self._differentiate(problem, seed)
        self.change_gradients(iteration)
        self._descend(problem)
        return Step(scored, loss.detach(), {name: term.detach() for name, term in terms.items()})

    def _differentiate(self, problem: FitProblem, seed: int | Tensor) -> tuple[Tensor, dict[str, Tensor]]:
        loss, terms = problem.loss(self.raw, seed)
        self.adam.zero_grad()
        loss.backward()
        return loss, terms

    def _descend(self, problem: FitProblem) -> None:
        self.adam.step()
        self._move_to(problem.parameterization.project(self.raw))

    def records(self, problem: FitProblem) -> bool:
        """Whether steps on a problem are recorded."""
        return (self.cuda_graph and self.recordable and self._device.type == "cuda"
                and not problem.waits)

    def _replay(self, problem: FitProblem, seed: int) -> Step:
        """A step from the recording, which is made for one problem and the parameters of one start."""
        if self._recorded is None or self._recorded[0] is not problem:
            self._recorded = (problem, self.recorder(lambda seed: self._recordable_step(problem, seed), self._device))
        values = self._recorded[1](seed)
        sizes = [value.numel() for value in self.raw.values()]
        *scored, scores = values.split([*sizes, len(values) - sum(sizes)])
        raw = {name: part.view_as(value) for (name, value), part in zip(self.raw.items(), scored, strict=True)}
        return Step(raw, scores[0], dict(zip(self._term_names, scores[1:].unbind(), strict=True)))

    def _recordable_step(self, problem: FitProblem, seed: Tensor) -> Tensor:
        """One step; the parameters scored, their loss and its terms in one tensor."""
        scored = torch.cat([value.detach().flatten() for value in self.raw.values()])  # a copy, before they move
        loss, terms = self._differentiate(problem, seed)
        self._descend(problem)
        self._term_names = list(terms)
        return torch.cat([scored, torch.stack([loss, *terms.values()]).detach()])

    @property
    def _device(self) -> torch.device:
        return next(iter(self.raw.values())).device

    def change_gradients(self, iteration: int) -> None:
        """A hook between the backward pass and Adam."""

    def state(self) -> dict[str, Tensor]:
        return {f"{name}/{key}": value.clone()
                for name, tensor in self.raw.items() for key, value in self.adam.state[tensor].items()}

    def load_state(self, state: Mapping[str, Tensor]) -> None:
        self.reset_moments()
        for name, tensor in self.raw.items():
            keys = [key for key in state if key.startswith(f"{name}/")]
            self.adam.state[tensor] = {key.split("/")[1]: state[key].clone() for key in keys}


class NoisyGradientDescent(GradientDescent):
    """Gradient descent with N(0, noise²) added to every gradient at every step: noisy gradients."""

    recordable = False  # the noise comes from the CPU

    def __init__(self, *, lr: float = 1e-2, noise: float = 0.1):
        super().__init__(lr=lr)
        if not noise >= 0:
            raise InputError(f"the gradient noise is a standard deviation, at least 0, got {noise}")
        self.noise = noise

    def change_gradients(self, iteration: int) -> None:
        random = generator(self.seed, "gradient noise", iteration)
        for tensor in self.raw.values():
            if tensor.grad is not None:
                tensor.grad += self.noise * _normal_like(tensor, random)


@dataclass(frozen=True)
class Move:
    """The random numbers of one proposal: standard normal `noise` for every raw parameter, and u, uniform in [0,1),
    which decides whether a rise is accepted."""

    noise: dict[str, Tensor]
    u: float


class Annealing:
    """Proposals and the rule that accepts them (Equation 7).

    spread: the standard deviation of a proposal is spread · temperature on every raw parameter (1/5 in the paper);
    sharpness: a rise dE is accepted with probability exp(-sharpness · dE / temperature) (10 in the paper).
    """

    def __init__(self, *, spread: float = 0.2, sharpness: float = 10.0):
        if not (spread > 0 and sharpness > 0):
            raise InputError(f"annealing needs spread > 0 and sharpness > 0, got {spread} and {sharpness}")
        self.spread, self.sharpness = spread, sharpness

    def draw(self, raw: Parameters, random: torch.Generator) -> Move:
        """The random numbers of the next proposal."""
        noise = {name: _normal_like(value, random) for name, value in raw.items()}
        return Move(noise, float(torch.rand((), generator=random)))

    def propose(self, raw: Parameters, parameterization: Parameterization, temperature: float,
                noise: Parameters) -> dict[str, Tensor]:
        """A projected random neighbour of `raw`; noise may carry a leading batch axis, then as many neighbours."""
        std = self.spread * temperature
        return parameterization.project({name: value.detach() + std * noise[name] for name, value in raw.items()})

    def accepts(self, rise: float, temperature: float, u: float) -> bool:
        """Whether a change of energy by `rise` is taken. A NaN never is."""
        if rise <= 0:
            return True
        return temperature > 0 and u < math.exp(-self.sharpness * rise / temperature)


class AnnealingOnly(Optimizer):
    """One candidate an iteration, judged by the whole objective: w/o gradients.

    The current state and the candidate are rendered together as a batch. common_random_numbers: with the same start
    points and map indices; otherwise each has its own.
    """

    scouting_temperature = 1.0

    def __init__(self, *, annealing: Annealing | None = None, common_random_numbers: bool = True):
        self.annealing, self.common_random_numbers = annealing or Annealing(), common_random_numbers

    @torch.no_grad()
    def step(self, problem: FitProblem, iteration: int, temperature: float) -> Step:
        move = self.annealing.draw(self.raw, generator(self.seed, "annealing", iteration))
        candidate = self.annealing.propose(self.raw, problem.parameterization, temperature, move.noise)
        both = {name: torch.stack([value, candidate[name]]) for name, value in self.raw.items()}
        loss, terms = problem.loss(both, self._points(iteration))
        scored = Step(self._copy(), loss[0], {name: term[0] for name, term in terms.items()})
        accepted = self.annealing.accepts(float(loss[1] - loss[0]), temperature, move.u)
        if accepted:
            self._move_to(candidate)
            scored = Step(self._copy(), loss[1], {name: term[1] for name, term in terms.items()})
        return Step(scored.raw, scored.loss, scored.terms, accepted=float(accepted))

    def _points(self, iteration: int) -> int | Tensor:
        """The seed of both renderings of a step, or one (2,) of each."""
        if self.common_random_numbers:
            return derive(self.seed, "energy", iteration)
        return torch.tensor([derive(self.seed, "energy", iteration, j) for j in range(2)])


class Alternating(GradientDescent):
    """Gradient descent interrupted by phases of simulated annealing: the hybrid optimiser of the paper.

    After every `every` iterations (250), while less than `until` (0.5) of the run is over, `candidates` (10) proposals
    are tried one after another, the centre moving with each accepted one, and Adam's moments are reset.
    common_random_numbers: render the current state and all candidates of a phase with the same start points and
    map indices, so that energies differ by the parameters alone; otherwise each render draws its own.
    energy_before_step: candidates are compared with the image from before Adam's step, as in the paper's appendix, and
    not with one of the state that they are proposed from.
    together: at most so many candidates are rendered as a batch (default: one on a CPU, any number on a GPU). Those
    that follow an accepted one are rendered again, from where the centre then is, so that the outcome is the same, to
    the rounding of energies. Not to waste many, a batch has one candidate after an accepted one, and twice as many as
    the last after one of which none was. Memory grows with the batch.
    """

    def __init__(self, *, lr: float = 1e-2, every: int = 250, candidates: int = 10, until: float = 0.5,
                 annealing: Annealing | None = None, common_random_numbers: bool = True,
                 energy_before_step: bool = False, together: int | None = None, cuda_graph: bool = True):
        super().__init__(lr=lr, cuda_graph=cuda_graph)
        if every < 1 or candidates < 1 or not 0 <= until <= 1:
            raise InputError("expected every >= 1, candidates >= 1 and until in [0, 1], got "
                             f"{every}, {candidates} and {until}")
        if together is not None and together < 1:
            raise InputError(f"at least one candidate is rendered at a time, got together={together}")
        self.every, self.candidates, self.until, self.together = every, candidates, until, together
        self.annealing = annealing or Annealing()
        self.common_random_numbers, self.energy_before_step = common_random_numbers, energy_before_step

    def step(self, problem: FitProblem, iteration: int, temperature: float) -> Step:
        step = super().step(problem, iteration, temperature)
        if (iteration + 1) % self.every or 1 - temperature >= self.until:
            return step
        accepted = self._anneal(problem, iteration, temperature, step)
        self.reset_moments()
        return Step(step.raw, step.loss, step.terms, accepted=accepted / self.candidates)

    def draws(self, iteration: int) -> tuple[list[Move], list[int]]:
        """The moves of a phase, and the seeds of the rendering of the current state and of each candidate's."""
        random = generator(self.seed, "annealing", iteration)
        moves = [self.annealing.draw(self.raw, random) for _ in range(self.candidates)]
        return moves, [derive(self.seed, "energy", iteration, 0 if self.common_random_numbers else j)
                       for j in range(self.candidates + 1)]

    def _current_energy(self, problem: FitProblem, iteration: int, step: Step, seed: int) -> float:
        if self.energy_before_step:
            return float(problem.energy(step.raw, derive(self.seed, "gradient", iteration)))
        return float(problem.energy(self.raw, seed))

    @property
    def at_a_time(self) -> int:
        """How many candidates are rendered as a batch, at most."""
        return self.together or (self.candidates if self._device.type == "cuda" else 1)

    @torch.no_grad()
    def _anneal(self, problem: FitProblem, iteration: int, temperature: float, step: Step) -> int:
        """A phase after `step`; how many candidates were accepted."""
        moves, seeds = self.draws(iteration)
        energy, tried, accepted, together = self._current_energy(problem, iteration, step, seeds[0]), 0, 0, 1
        while tried < self.candidates:
            ahead = moves[tried:tried + together]
            together = min(2 * together, self.at_a_time)
            noise = {name: torch.stack([move.noise[name] for move in ahead]) for name in self.raw}
            proposed = self.annealing.propose(self.raw, problem.parameterization, temperature, noise)
            energies = problem.energy(proposed, torch.tensor(seeds[tried + 1:tried + 1 + len(ahead)])).tolist()
            for place, (move, there) in enumerate(zip(ahead, energies, strict=True)):
                tried += 1
                if self.annealing.accepts(there - energy, temperature, move.u):
                    self._move_to({name: value[place] for name, value in proposed.items()})
                    energy, accepted, together = there, accepted + 1, 1
                    break  # the centre has moved, and the others are to be proposed from there
        return accepted


def _normal_like(value: Tensor, random: torch.Generator) -> Tensor:
    """Standard normal numbers drawn on the CPU, so that every device sees the same ones."""
    return torch.randn(value.shape, generator=random).to(value.device)
