"""The one road from a target to a verdict. Likeness and verdict are made here alone, whatever the method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import torch

from ..cameras.camera import Camera
from ..cameras.kinds import kind_of
from ..cameras.params import CameraParams
from ..colouring import colour_error, fitted
from ..ifs.code import IFS
from ..images.painted import Painted
from ..images.reading import ReadImage
from ..likeness import Likeness, camera_for, redrawn
from ..methods.base import CodeReconstruction, Method, OnStep, Progress, Reconstruction, stop_reason
from ..methods.history import History, StageRecord
from ..rendering.tone import Tone, own_tone, with_tone
from ..runtime.checkpoint import Checkpoint
from ..verdict import Verdict
from .result import Inversion, warnings_of

INTERRUPTED = "interrupted"
LAST_CODES = 4  # how many codes of an interrupted search are compared: a later stage may find a worse one


@dataclass(frozen=True)
class Work:
    """What a method did: what it found, its stages, the codes on the way with the seconds since the start and the
    step, why it stopped, how many seconds it took, and what its user knew of the camera."""

    found: Reconstruction
    stages: tuple[StageRecord, ...] = ()
    course: tuple[tuple[float, int, IFS], ...] = ()
    stopped: str = ""
    seconds: float = 0.0
    camera: CameraParams = CameraParams()


def run(target: ReadImage, method: Method, *, name: str, options: Mapping[str, Any] | None = None, seed: int = 0,
        on_step: OnStep | None = None, checkpoint: Checkpoint | None = None, keep_interrupted: bool = False
        ) -> Inversion:
    """Let a method reconstruct a target, and judge the code: `reconstruct`, then `conclude`."""
    work = reconstruct(target, method, seed=seed, on_step=on_step, checkpoint=checkpoint,
                       keep_interrupted=keep_interrupted)
    return conclude(work, target, name=name, options=options, seed=seed)


def reconstruct(target: ReadImage, method: Method, *, seed: int = 0, on_step: OnStep | None = None,
                checkpoint: Checkpoint | None = None, keep_interrupted: bool = False) -> Work:
    """Let a method reconstruct a target. on_step, checkpoint: as for `Method.reconstruct`; keep_interrupted: an
    interruption (Ctrl-C) ends the work with the best code so far, if there is one, instead of raising
    KeyboardInterrupt. Raises `InputError`, before any work, if the method cannot use the target."""
    told: list[CodeReconstruction] = []
    # Codes are kept before they are told: what a method hands over after an interruption may interrupt `on_step` again.
    history = History([each for each in (partial(_note, told), on_step) if each is not None])
    try:
        found, stopped = method.reconstruct(target, on_step=history, checkpoint=checkpoint), ""
    except KeyboardInterrupt:
        if not (keep_interrupted and told):
            raise
        found, stopped = _most_alike(told[-LAST_CODES:], target, method.camera, seed), INTERRUPTED
    took = history.seconds()
    return Work(found, history.stages(), tuple(history.course),
                stopped or stop_reason(found, getattr(method, "seconds", None), took), took, method.camera)


def conclude(work: Work, target: ReadImage, *, name: str, options: Mapping[str, Any] | None = None, seed: int = 0,
             truth: tuple[bool, bool] | None = None) -> Inversion:
    """The result of a method's work on a target. name: of the method; options: that were given, for the record and for
    what may help; truth: whether the code is the true one, exactly or but for its maps, where that is known. Raises
    TypeError if the method found no code."""
    found, options = work.found, options or {}
    if not isinstance(found, CodeReconstruction):
        raise TypeError(f"the method {name!r} returned a {type(found).__name__}, which is not a code")
    camera = found.camera or camera_for(found.code, target, params=work.camera, seed=seed)
    likeness = Likeness.of(found.code, target, camera, params=work.camera, seed=seed)
    verdict = Verdict.of(likeness, len(found.code), target, stopped=work.stopped, options=options)
    if truth is not None:
        verdict = verdict.against_truth(*truth)
    tone = _tone(found.code, target, camera, work.camera, seed)
    return Inversion(
        code=with_tone(found.code, tone), target=target,
        source=target.image if target.source is None else target.source, likeness=likeness, verdict=verdict,
        camera=camera, history=work.stages, stopped=work.stopped, seconds=work.seconds, method=name,
        options=options, notes=(*target.notes, *found.notes),
        curve=tuple(replace(each, code=with_tone(each.code, tone)) for each in found.curve),
        warnings=warnings_of(target, verdict, likeness, work.stopped))


def coloured(shape: Inversion, painted: Painted, seed: int = 0) -> Inversion:
    """The result with the picture's colours: its maps, and so its likeness in shape, are the same."""
    code = fitted(shape.code, painted, seed)
    if code is None:
        note = "no colours: hardly any pixel is lit by both the code and the picture"
        return replace(shape, notes=(*shape.notes, note), warnings=(*shape.warnings, note))
    if tone := own_tone(code):
        code = with_tone(code, tone.covering(torch.from_numpy(painted.cover)))
    grey = ["the picture is grey, so the colours found are greys"] if painted.is_grey else []
    likeness = replace(shape.likeness, colour=colour_error(code, painted, seed))
    return replace(shape, code=code, likeness=likeness, verdict=shape.verdict.with_colours(likeness.colour),
                   notes=(*shape.notes, *grey))


def _tone(code: IFS, target: ReadImage, camera: Camera, params: CameraParams, seed: int) -> Tone | None:
    """The tone of what the camera draws of a code, if its grey levels are a density that others drew."""
    is_linear = kind_of(camera.kind).is_linear
    if camera.gain is None and not is_linear:
        return None
    drawn = redrawn(code, target, camera, params=params, seed=seed).cpu()
    return Tone.of_picture(drawn, camera.gamma or 1.0, linear=is_linear)


def _note(told: list[CodeReconstruction], progress: Progress) -> None:
    """Keep the code that a method tells, in the place of the one before if that is the same, or a draft of it."""
    if progress.code is None:
        return
    if told and (told[-1].camera is None or told[-1].code.to_json() == progress.code.to_json()):
        told.pop()
    told.append(CodeReconstruction(progress.code, camera=progress.camera))


def _most_alike(told: Sequence[CodeReconstruction], target: ReadImage, params: CameraParams, seed: int
                ) -> CodeReconstruction:
    """The code that is most like the picture, with its camera. Only the last one may not have been judged by any."""
    last = told[-1]
    seen = [*told[:-1], replace(last, camera=last.camera or camera_for(last.code, target, params=params, seed=seed))]
    return seen[0] if len(seen) == 1 else max(
        seen, key=lambda each: Likeness.of(each.code, target, each.camera, params=params, seed=seed).f1_1px)
