"""The one contract of all methods: a target image in, a reconstruction out."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import torch
from torch import Tensor

from ..cameras.camera import Camera
from ..cameras.params import CameraParams
from ..errors import InputError
from ..ifs.code import IFS, View
from ..images.levels import TargetImage
from ..runtime.checkpoint import Checkpoint
from ..runtime.checks import check_unit
from ..runtime.deadline import Deadline
from ..runtime.params import Params

SHOWN = {"loss": "↓", "error": "↓", "held_out": "↓", "mean_code": "", "bicubic": "", "other_pictures": "",
         "temperature": "", "maps": ""}  # scalars; an arrow says which way is better
ALL_DONE = "all stages done"
NEARLY_ALL = 0.95  # of a time limit: a method that ends after it, and does not say why, has skipped what was left


@dataclass(frozen=True)
class Progress:
    """What a method tells while it works: the step, the fraction done in [0,1], named scalars, the name of the stage,
    now and then a preview image (R,R), and at the end of a stage the code that it found, with the camera that judged
    it; a code that no camera has judged yet is one that the next stage goes on from. candidate: the best code so far,
    told only as long as no stage has ended; only some methods tell it."""

    step: int
    fraction: float
    scalars: Mapping[str, float] = field(default_factory=dict)
    preview: Tensor | None = None
    stage: str | None = None
    code: IFS | None = None
    candidate: IFS | None = None
    camera: Camera | None = None

    def describe(self) -> str:
        """The stage and what is being improved, in words; ↓ stands after what is better when lower."""
        told = [f"{name.replace('_', ' ')} {self.scalars[name]:.3g}{arrow}" for name, arrow in SHOWN.items()
                if name in self.scalars]
        return ", ".join([*([self.stage] if self.stage else []), *told])


OnStep = Callable[[Progress], None]
AnyTarget = Tensor | TargetImage   # a bare image means what it looks like


class FitDiverged(RuntimeError):
    """A fit met a NaN or an infinity; the message says where, and where its last good state lies."""


class Reconstruction(ABC):
    """What a method returns: something that can be drawn at any view."""

    @abstractmethod
    def render(self, view: View, *, resolution: int, points_in_view: int | None = None, supersample: int = 8,
               seed: int = 0) -> Tensor:
        """The grey image (R,R) in [0,1] of a view, as evaluation draws it."""


@dataclass(frozen=True)
class CurvePoint:
    """A code of so many `maps` for a shape: the `likeness` of what it draws, F1 within a pixel in [0,1], and the
    `bytes` that it takes, if every number of a map takes two."""

    maps: int
    likeness: float
    bytes: int
    code: IFS


@dataclass(frozen=True)
class CodeReconstruction(Reconstruction):
    """A reconstruction that is an IFS, in the frame of the input image.

    stopped: why the work ended, in words; empty where the method does not say. notes: sentences for the user.
    camera: how the picture was drawn, as far as the method found out; None where it did not try.
    curve: codes of more and more maps, where the method made them to choose from.
    evaluations: how many images of codes were drawn and compared to find it; None where the method does not count.
    """

    code: IFS
    stopped: str = ""
    notes: tuple[str, ...] = ()
    camera: Camera | None = None
    curve: tuple[CurvePoint, ...] = ()
    evaluations: int | None = None

    def render(self, view: View, *, resolution: int, points_in_view: int | None = None, supersample: int = 8,
               seed: int = 0) -> Tensor:
        from ..rendering.still import render

        return render(self.code, view, resolution=resolution, points_in_view=points_in_view, supersample=supersample,
                      seed=seed)


class Method(ABC):
    """Reconstructs an image as something that can be drawn at any view. A method knows no tracker, no file names and no
    configuration.

    Params: the class of its parameters, where it has one; its fields are options of the constructor.
    """

    Params: ClassVar[type[Params] | None] = None

    @property
    def camera(self) -> CameraParams:
        """What the user knows of how a picture was drawn."""
        return CameraParams()

    def check(self, target: AnyTarget) -> None:
        """Raise the `InputError` that `reconstruct` would raise on this image, without any work."""
        check_target(target)

    def deadline(self, target: AnyTarget) -> Deadline:
        """The time limit for a target, starting now."""
        return Deadline(getattr(self, "seconds", None))

    def fingerprint(self) -> str | None:
        """What tells this method from another one with the same parameters: the digest of trained weights; None where
        there is nothing of the kind. Raises `InputError` if the weights cannot be read."""
        return None

    @abstractmethod
    def reconstruct(self, target: AnyTarget, *, on_step: OnStep | None = None,
                    checkpoint: Checkpoint | None = None) -> Reconstruction:
        """Reconstruct a target, or a square image (R,R) in [0,1], the shape white on black, whose levels mean what they
        look like.

        on_step is called after every step; with a checkpoint the work is saved as it says and can be resumed. Raises
        `InputError` on an unusable image before any work, and `FitDiverged` if the work breaks down.
        """


def stop_reason(reconstruction: Reconstruction, limit: float | None, seconds: float) -> str:
    """Why a method stopped, in words: as it says itself, or by the time that it took against its limit in seconds."""
    if isinstance(reconstruction, CodeReconstruction) and reconstruction.stopped:
        return reconstruction.stopped
    return time_is_up(Deadline(limit)) if limit is not None and seconds > NEARLY_ALL * limit else ALL_DONE


def time_is_up(limit: Deadline) -> str:
    """The reason of a method that its time limit has ended."""
    return f"the time limit of {limit.words} was reached"


def check_device(device: str) -> str:
    """The device, or `InputError` if there is none of this name on this machine."""
    try:
        kind = torch.device(device).type
    except RuntimeError as error:
        raise InputError(f"there is no device {device!r}; take cpu or cuda") from error
    if kind == "cuda" and not torch.cuda.is_available():
        raise InputError(f"device={device!r} needs an NVIDIA GPU and its driver, torch finds none; take device=cpu")
    return device


def check_target(target: AnyTarget, resolution: int | None = None) -> Tensor:
    """The image as float32, or `InputError` unless it is a finite square (R,R) in [0,1] with something on it."""
    target = torch.as_tensor(target.image if isinstance(target, TargetImage) else target)
    if target.ndim != 2 or target.shape[0] != target.shape[1]:
        raise InputError(f"a target image must be square, shape (R, R), got {tuple(target.shape)}; "
                         "fractal_exp.images.read_target makes one from any picture")
    if resolution is not None and target.shape[0] != resolution:
        raise InputError(f"the target has {target.shape[0]}² pixels, but the model draws {resolution}²; read the "
                         "target at the model's resolution")
    target = target.to(torch.float32)
    check_unit("the target image", target)
    if bool((target == target[0, 0]).all()):
        raise InputError(f"the target image is constant ({float(target[0, 0]):.4g}): there is no shape on it")
    return target


def resized(image: Tensor, side: int | None) -> Tensor:
    """The image (R,R) with `side` pixels a side, each the mean of the area that it covers, so that a smaller image is
    enlarged by repeating its pixels; None: as it is."""
    if side is None or side == len(image):
        return image
    return torch.nn.functional.interpolate(image[None, None], (side, side), mode="area")[0, 0]
