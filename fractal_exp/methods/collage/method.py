"""Collage search as a method: from the measure that a picture shows to the code itself."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

from torch import Tensor

from ...errors import InputError
from ...ifs.code import IFS
from ...runtime.checkpoint import Checkpoint
from ..base import CodeReconstruction, Method, OnStep, Progress, check_device, check_target
from .measure import LEVELS, guess_levels
from .memory import MemoryBudget
from .search import Tiling
from .stages import Problem, Stage, plan
from .work import Work

SMALLEST_INPUT = 32
ROUNDS = {"density": 4, "coverage": 2, "binary": 2}   # of others it is less likely that they are of an attractor


class Collage(Method):
    """Recover a code by the collage theorem (Barnsley 1985): maps are sought that tile the picture with copies of it.

    In stages (docs/collage.md): a large neighbourhood search of `moves` steps on a 64² grid, up to `islands` times
    from nothing, the maps of all mixed, and once from the mixture; then `detail_moves` on a 128² grid of the picture's
    measure, corrected for the saturation of its grey levels by what was found so far; refinement on grids up to
    `finest` cells a side and on the picture itself; and `picture_moves` that add, turn, replace and remove maps where
    the picture asks for it, up to three times as many while the error is being halved. If the code is still far from
    the picture, there is another round, with half as many islands and the maps found so far in the mixture. An image
    beyond 512² is searched at a fraction of its size, and the code polished on the whole, or on 1024² of a still larger
    one. In the end entries near to simple numbers are rounded and the input's frame is filled exactly, unless it is
    drawn worse for it.

    maps: the number of maps, found if None; at_most: its upper bound; levels: what grey levels mean, "density" of the
    points of a chaos game, "coverage" of pixels by the shape, "binary", or "auto"; rounds: at most so many, None: four
    where grey levels are a density, two of other pictures; proposals: neighbours judged at once, by as many threads.
    seconds: a limit after which what is left of each stage is skipped (and a run can no longer be repeated bit for bit,
    as on a GPU). memory_gib: what may be taken of memory beside the 0.8 GiB of libraries; with little the search is
    coarser (`collage.memory`). A checkpoint is saved after every stage and at an interruption. previews: how many
    preview images are reported. device: where tensors live.
    Raises `InputError` on values out of range.
    """

    def __init__(self, *, islands: int = 5, moves: int = 50, rounds: int | None = None, detail_moves: int = 25,
                 picture_moves: int = 60, maps: int | None = None, at_most: int | None = None,
                 levels: Literal["auto", "density", "coverage", "binary"] = "auto", finest: int = 256,
                 proposals: int = 2, seconds: float | None = None, memory_gib: float | None = None, seed: int = 0,
                 previews: int = 10, device: str = "cpu"):
        for name, value, least in (("islands", islands, 1), ("moves", moves, 0), ("rounds", rounds, 1),
                                   ("detail_moves", detail_moves, 0), ("picture_moves", picture_moves, 0),
                                   ("maps", maps, 2), ("at_most", at_most, 2), ("finest", finest, 64),
                                   ("proposals", proposals, 1), ("previews", previews, 0)):
            if value is not None and value < least:
                raise InputError(f"{name} must be at least {least}, got {value}")
        if maps is not None and at_most is not None:
            raise InputError(f"give the number of maps or its upper bound, not both; got maps={maps} and "
                             f"at_most={at_most}")
        if levels not in ("auto", *LEVELS):
            raise InputError(f"levels must be one of auto, {', '.join(LEVELS)}, got {levels!r}")
        if seconds is not None and not seconds > 0:
            raise InputError(f"seconds must be above 0 (or none for no limit), got {seconds}")
        if memory_gib is not None and not memory_gib > 0:
            raise InputError(f"memory_gib must be above 0 (or none for no limit), got {memory_gib}")
        self.islands, self.moves, self.rounds, self.detail_moves = islands, moves, rounds, detail_moves
        self.picture_moves, self.levels, self.finest, self.proposals = picture_moves, levels, finest, proposals
        self.maps, self.at_most = maps, at_most
        self.seconds, self.memory_gib, self.seed, self.previews = seconds, memory_gib, seed, previews
        self.device = check_device(device)

    def check(self, target: Tensor) -> None:
        target = check_target(target)
        if target.shape[0] < SMALLEST_INPUT:
            raise InputError(f"collage search needs an image of at least {SMALLEST_INPUT}², got {target.shape[0]}²; "
                             "read the picture at a larger resolution")
        MemoryBudget(self.memory_gib, target.shape[0], LEVELS[self._levels_of(target)].supersample)

    def _levels_of(self, image: Tensor) -> str:
        return guess_levels(image) if self.levels == "auto" else self.levels

    def reconstruct(self, target: Tensor, *, on_step: OnStep | None = None,
                    checkpoint: Checkpoint | None = None) -> CodeReconstruction:
        self.check(target)
        image = check_target(target).to(self.device)
        meaning = self._levels_of(image)
        levels, rounds = LEVELS[meaning], self.rounds or ROUNDS[meaning]
        clock = _Clock(self.seconds)
        problem = Problem(image, levels, self.seed, self.proposals, self.finest, self.maps, self.at_most,
                          lambda: clock.part, self.memory_gib)
        stages = plan(problem, rounds=rounds, islands=self.islands, moves=self.moves,
                      detail_moves=self.detail_moves, picture_moves=self.picture_moves)
        snapshot = checkpoint.load() if checkpoint else None
        work = told = Work.of(snapshot, self.device) if snapshot else Work()
        size = problem.image.shape[0]
        tell = _Teller(on_step, stages, clock, self.previews, lambda code: levels.observe(code, size, self.seed))
        try:
            while work.stage < len(stages):
                stage = stages[work.stage]
                if work.result is not None and work.tiling is None and clock.part >= stage.ends:
                    work = work.done(work.best)
                    continue
                stage.open(work)
                if work.tiling is None:
                    work = replace(work, tiling=stage.begin(work))
                while work.step < stage.moves and clock.part < stage.ends and not stage.settled(work):
                    work = work.moved(stage.step(work.tiling, work.step))
                    tell(work)
                    told = work
                work = stage.close(work)
                tell.end_of(stage, work)
                told = work
                if checkpoint:
                    checkpoint.save(told.snapshot())
        except KeyboardInterrupt:
            if checkpoint:  # not a step further than what was told: the resumed search does not tell it again
                checkpoint.save(told.snapshot())
            raise
        return CodeReconstruction(work.result.code.to("cpu").check_contractive())


def laptop(*, resolution: int = 256, islands: int = 5, moves: int = 50, rounds: int | None = None,
           detail_moves: int = 25, picture_moves: int = 60, maps: int | None = None, at_most: int | None = None,
           levels: str = "auto", finest: int = 256, seed: int = 0, seconds: float | None = None,
           memory_gib: float | None = None) -> Collage:
    """The method at the sizes that two cores finish within a minute. It takes images of any resolution from 32² on."""
    if resolution < SMALLEST_INPUT:
        raise InputError(f"resolution must be at least {SMALLEST_INPUT}, got {resolution}")
    return Collage(islands=islands, moves=moves, rounds=rounds, detail_moves=detail_moves, picture_moves=picture_moves,
                   maps=maps, at_most=at_most, levels=levels, finest=finest, seed=seed, seconds=seconds,
                   memory_gib=memory_gib)


class _Teller:
    """Tells `on_step` what there is to tell: scores and the count of steps after each, a preview now and then, and at
    the end of a stage its code."""

    def __init__(self, on_step: OnStep | None, stages: list[Stage], clock: _Clock, previews: int,
                 draw: Callable[[IFS], Tensor]):
        self.on_step, self.stages, self.clock, self.draw = on_step, stages, clock, draw
        self.total = max(1, sum(stage.expected for stage in stages))
        self.every = max(1, self.total // previews) if previews else 0

    def __call__(self, work: Work) -> None:
        """After a step."""
        if self.on_step:
            step = self._steps_before(work.stage) + work.step
            wanted = self.every and step % self.every == 0
            self._tell(step, work.stage, work.tiling, preview=self.draw(work.tiling.code) if wanted else None)

    def end_of(self, stage: Stage, work: Work) -> None:
        """After a stage."""
        if self.on_step:
            number = self.stages.index(stage)
            self._tell(self._steps_before(number) + stage.moves, number, work.result, code=work.result.code)

    def _tell(self, step: int, stage: int, tiling: Tiling, **more: Tensor | IFS | None) -> None:
        scalars = {"score": tiling.score, "error": tiling.error, "maps": float(len(tiling.maps)),
                   "stage": float(stage)}
        here, now = step - self._steps_before(stage), self.stages[stage]
        before = sum(earlier.expected for earlier in self.stages[:stage])
        done = max((before + min(here / max(now.asked, 1), 1) * now.expected) / self.total, self.clock.part)
        self.on_step(Progress(step, min(1.0, done), scalars, stage=self.stages[stage].name, **more))

    def _steps_before(self, stage: int) -> int:
        return sum(earlier.moves for earlier in self.stages[:stage])


class _Clock:
    """What part of the time has passed: 0 for ever without a limit."""

    def __init__(self, seconds: float | None):
        self.seconds, self.start = seconds, time.monotonic()

    @property
    def part(self) -> float:
        return (time.monotonic() - self.start) / self.seconds if self.seconds else 0.0
