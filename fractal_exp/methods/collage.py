"""Collage search as a method: from the measure that a picture shows to the code itself."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Literal

from torch import Tensor

from ..checkpoint import Checkpoint, Snapshot
from ..collage import maps as affine
from ..collage.measure import LEVELS, Levels, desaturated, guess_levels
from ..collage.refine import PictureError, grid_for, refinements
from ..collage.search import Judge, Search, Tiling
from ..errors import InputError
from ..ifs import IFS
from ..seeds import derive
from .base import CodeReconstruction, Method, OnStep, Progress, check_device, check_target

SMALLEST_INPUT = 32
SEARCH_PART, DETAIL_PART = 0.5, 0.4  # of the time, where it is limited; the rest is for refinement


class Collage(Method):
    """Recover a code by the collage theorem (Barnsley 1985): maps are sought that tile the picture with copies of it.

    Three stages (docs/collage.md): `moves` steps of a large neighbourhood search on a 64² grid; then, `rounds` times,
    `detail_moves` on a 128² grid of the picture's measure, corrected for the saturation of its grey levels by what
    was found so far; then refinement on grids up to `finest` cells a side.

    maps: the number of maps, found if None; at_most: its upper bound; levels: what grey levels mean, "density" of the
    points of a chaos game, "coverage" of pixels by the shape, or "auto"; proposals: neighbours judged at once, by as
    many threads. seconds: a limit after which the stages that are left are cut short (and a run can no longer be
    repeated bit for bit). previews: how many preview images are reported. device: where tensors live. Raises
    `InputError` on values out of range.
    """

    def __init__(self, *, moves: int = 150, rounds: int = 2, detail_moves: int = 30, maps: int | None = None,
                 at_most: int | None = None, levels: Literal["auto", "density", "coverage"] = "auto",
                 finest: int = 512, proposals: int = 2, seconds: float | None = None, seed: int = 0,
                 previews: int = 10, device: str = "cpu"):
        for name, value, least in (("moves", moves, 0), ("rounds", rounds, 0), ("detail_moves", detail_moves, 0),
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
        self.moves, self.rounds, self.detail_moves = moves, rounds, detail_moves
        self.maps, self.at_most, self.levels, self.finest = maps, at_most, levels, finest
        self.proposals, self.seconds, self.seed, self.previews = proposals, seconds, seed, previews
        self.device = check_device(device)

    def check(self, target: Tensor) -> None:
        target = check_target(target)
        if target.shape[0] < SMALLEST_INPUT:
            raise InputError(f"collage search needs an image of at least {SMALLEST_INPUT}², got {target.shape[0]}²; "
                             "read the picture at a larger resolution")

    def reconstruct(self, target: Tensor, *, on_step: OnStep | None = None,
                    checkpoint: Checkpoint | None = None) -> CodeReconstruction:
        self.check(target)
        image = check_target(target).to(self.device)
        levels = LEVELS[guess_levels(image) if self.levels == "auto" else self.levels]
        masses = levels.measure(image)
        work = self._saved(checkpoint)
        clock = _Clock(self.seconds)
        while work.stage <= self.rounds:
            search, planned = self._search(work, masses, levels), self._planned(work.stage)
            if work.tiling is None:
                work = replace(work, tiling=search.start() if work.origin is None
                               else search.resume(work.origin.maps, work.origin.weights))
            while work.step < planned and clock.part < self._ends(work.stage):
                try:
                    work = replace(work, tiling=search.step(work.tiling, work.step), step=work.step + 1)
                    self._report(on_step, work, clock, levels, image.shape[0])
                    if checkpoint and work.step % checkpoint.every == 0:
                        checkpoint.save(work.snapshot())
                except KeyboardInterrupt:
                    if checkpoint:
                        checkpoint.save(work.snapshot())
                    raise
            work = _Work(work.stage + 1, 0, None, work.tiling)
        return CodeReconstruction(self._refined(work.origin, masses, levels, clock).check_contractive())

    def _search(self, work: _Work, masses: Tensor, levels: Levels) -> Search:
        """The search of a stage: of the picture as it is, or as corrected by what the stage began with."""
        bounds = {"fixed": self.maps, "most": self.at_most, "proposals": self.proposals}
        resolution, seed = masses.shape[0], derive(self.seed, "stage", work.stage)
        if work.stage == 0:
            size = grid_for(resolution, 64)
            return Search(masses, size=size, coarse=size // 2, seed=seed, **bounds)
        size = grid_for(resolution, 128)
        origin = affine.to_code(work.origin.maps, work.origin.weights)
        return Search(desaturated(masses, origin, levels, seed), size=size, coarse=size // 2,
                      judge=Judge(price=1e-4, prior=0.03), fine_details=True, count=24, seed=seed, **bounds)

    def _planned(self, stage: int) -> int:
        return self.detail_moves if stage else self.moves

    def _ends(self, stage: int) -> float:
        """The part of the time at which a stage must end."""
        return SEARCH_PART + DETAIL_PART * stage / max(1, self.rounds)

    def _report(self, on_step: OnStep | None, work: _Work, clock: _Clock, levels: Levels, resolution: int) -> None:
        if not on_step:
            return
        total = self.moves + self.rounds * self.detail_moves
        step = work.step + (self.moves + (work.stage - 1) * self.detail_moves if work.stage else 0)
        wanted = self.previews and step % max(1, total // self.previews) == 0
        tiling = work.tiling
        preview = levels.observe(affine.to_code(tiling.maps, tiling.weights).to("cpu"), resolution,
                                 self.seed) if wanted else None
        scalars = {"score": tiling.score, "collage_error": tiling.error, "maps": float(len(tiling.maps)),
                   "stage": float(work.stage)}
        on_step(Progress(step, min(1.0, max(step / total, clock.part)), scalars, preview))

    def _refined(self, tiling: Tiling, masses: Tensor, levels: Levels, clock: _Clock) -> IFS:
        """The code that draws the picture best, of what the search found and each of its refinements."""
        error = PictureError(masses, levels, self.seed)
        free, tied = affine.to_code(tiling.maps, tiling.weights), affine.to_code(tiling.maps)
        found = [(error(code), code) for code in (tied, free)]
        for code in refinements(tied, masses, levels, self.finest, self.seed):
            found.append((error(code), code))
            if clock.part >= 1:
                break
        return min(found, key=lambda pair: pair[0])[1]

    @staticmethod
    def _saved(checkpoint: Checkpoint | None) -> _Work:
        snapshot = checkpoint.load() if checkpoint else None
        return _Work.of(snapshot) if snapshot else _Work(0, 0, None, None)


def laptop(*, resolution: int = 256, moves: int = 150, rounds: int = 2, detail_moves: int = 30,
           maps: int | None = None, at_most: int | None = None, levels: str = "auto", finest: int = 512,
           seed: int = 0, seconds: float | None = None) -> Collage:
    """The method at the sizes that two cores finish within a minute. It takes images of any resolution from 32² on."""
    if resolution < SMALLEST_INPUT:
        raise InputError(f"resolution must be at least {SMALLEST_INPUT}, got {resolution}")
    return Collage(moves=moves, rounds=rounds, detail_moves=detail_moves, maps=maps, at_most=at_most, levels=levels,
                   finest=finest, seed=seed, seconds=seconds)


@dataclass(frozen=True)
class _Work:
    """How far the search has come: the stage, its step, its tiling, and the tiling that the stage began with."""

    stage: int
    step: int
    tiling: Tiling | None
    origin: Tiling | None

    def snapshot(self) -> Snapshot:
        kept = {name: t for name, t in (("tiling", self.tiling), ("origin", self.origin)) if t is not None}
        tensors = {f"{name}/{part}": getattr(t, part) for name, t in kept.items() for part in ("maps", "weights")}
        numbers = {name: [t.error, t.score] for name, t in kept.items()}
        return Snapshot(self.step, tensors, {"stage": self.stage, **numbers})

    @classmethod
    def of(cls, snapshot: Snapshot) -> _Work:
        def tiling(name: str) -> Tiling | None:
            if name not in snapshot.numbers:
                return None
            return Tiling(snapshot.tensors[f"{name}/maps"], snapshot.tensors[f"{name}/weights"],
                          *snapshot.numbers[name])

        return cls(snapshot.numbers["stage"], snapshot.iteration, tiling("tiling"), tiling("origin"))


class _Clock:
    """What part of the time has passed: 0 for ever without a limit."""

    def __init__(self, seconds: float | None):
        self.seconds, self.start = seconds, time.monotonic()

    @property
    def part(self) -> float:
        return (time.monotonic() - self.start) / self.seconds if self.seconds else 0.0
