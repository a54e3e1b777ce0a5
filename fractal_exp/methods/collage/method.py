"""Collage search as a method: it recovers a code from the measure that an image shows."""

from __future__ import annotations

from typing import Any

from ...cameras.kinds import levels_of, with_camera
from ...cameras.levels import Levels
from ...cameras.params import CameraParams
from ...errors import InputError
from ...images.levels import TargetImage
from ...runtime.checkpoint import Checkpoint
from ...runtime.checks import check_count, check_seconds
from ...runtime.deadline import Deadline
from ..base import AnyTarget, CodeReconstruction, CurvePoint, Method, OnStep, check_device, check_target
from .params import BYTES_OF_A_MAP, CollageParams
from .pipeline import Pipeline, Teller
from .stages import plan_of
from .stages.base import SearchProblem
from .state import State

SMALLEST_INPUT = 32
ENDED = "the picture shows a few steps of a construction; the attractor of the code goes on beyond them"


class Collage(Method):
    """Recover a code by the collage theorem (Barnsley 1985): find maps that tile the image with copies of it.

    docs/method.md explains the stages. seconds: a time limit, after which the rest of each stage is skipped; a run that
    a limit ends cannot be repeated bit for bit. Without one, a search for the code of a picture from elsewhere ends
    after `runtime.deadline.USUAL` seconds of a core, and every other search when it is done. seed: for all random
    numbers. previews: how many preview images are reported. device: where tensors live. options: the parameters of
    `CollageParams`; a component takes a mapping, as in `Collage(maps=4, moves={"root": 0})`. A checkpoint is saved
    after every stage and at an interruption.

    Raises `InputError` if a value is out of range.
    """

    Params = CollageParams

    def __init__(self, *, seconds: float | None = None, seed: int = 0, previews: int = 10, device: str = "cpu",
                 **options: Any):
        check_seconds(seconds)
        check_count("previews", previews, 0)
        self.params = CollageParams().updated(**options)
        self.seconds, self.seed, self.previews, self.device = seconds, seed, previews, check_device(device)

    @property
    def camera(self) -> CameraParams:
        return self.params.camera

    def check(self, target: AnyTarget) -> None:
        side = len(check_target(target))
        if side < SMALLEST_INPUT:
            raise InputError(f"collage search needs an image of at least {SMALLEST_INPUT}², got {side}²; "
                             "read the picture at a larger resolution")
        self._levels(target)

    def _levels(self, target: AnyTarget) -> Levels:
        """The levels of a target. Raises `InputError` if they have no camera with what the user knows of it."""
        given = TargetImage.of(target)
        return levels_of(check_target(target).to(self.device), given.levels, self.camera, given.known)

    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None, checkpoint: Checkpoint | None = None
                    ) -> CodeReconstruction:
        self.check(target)
        levels = self._levels(target)
        problem = SearchProblem(levels.picture, levels, self.params, self.seed, self.deadline(target))
        plan, size = plan_of(problem), len(problem.image)
        snapshot = checkpoint.load() if checkpoint else None
        teller = Teller(on_step, plan, self.previews, lambda code: levels.render(code, size, self.seed))

        def save(state: State) -> None:
            if checkpoint:
                checkpoint.save(state.snapshot())

        pipeline = Pipeline(plan, State.of(snapshot, self.device) if snapshot else State(), on_move=teller.move,
                            on_stage=teller.stage, save=save)
        try:
            best = pipeline.run()
        except KeyboardInterrupt:
            save(pipeline.state)
            pipeline.hand_over()
            raise
        state = pipeline.state
        curve = tuple(CurvePoint(len(each.maps), each.likeness, BYTES_OF_A_MAP * len(each.maps), each.code)
                      for each in state.curve)
        seen = with_camera(levels, problem.camera_of(best))
        return CodeReconstruction(best.code.to("cpu").check_contractive(), stopped=state.stopped, curve=curve,
                                  notes=() if seen.shows_attractor else (ENDED,),
                                  camera=seen.camera)

    def deadline(self, target: AnyTarget) -> Deadline:
        is_open_ended = not self._levels(target).is_exact and not self.params.grows_at_once
        return Deadline.usual() if self.seconds is None and is_open_ended else Deadline(self.seconds)


def laptop(*, resolution: int = 256, seed: int = 0, seconds: float | None = None, previews: int = 0, **options: Any
           ) -> Collage:
    """The method with the sizes of a laptop. It takes images of any resolution from 32²."""
    if resolution < SMALLEST_INPUT:
        raise InputError(f"resolution must be at least {SMALLEST_INPUT}, got {resolution}")
    return Collage(seed=seed, seconds=seconds, previews=previews, **options)
