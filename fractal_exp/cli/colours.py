"""The colours of a fit, as `colour=true` asks for them: what is checked before it, and what is found after it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..colouring import colour_error, fitted
from ..errors import InputError
from ..ifs.code import IFS
from ..images.painted import Painted
from ..methods import WITHOUT_CODE
from ..rendering.colour import on_ground
from ..rendering.still import render
from ..runtime.extras import need
from ..targets import Target
from .judging import Judgement


@dataclass(frozen=True)
class Coloured:
    """A code with the colours of a picture. error: the mean CIEDE2000 difference, or None if no pixel is lit in both;
    picture: the picture and, on its right, the code's rendering on the picture's ground, (S,2S,3) in [0,1]."""

    code: IFS
    error: float | None
    picture: np.ndarray

    @classmethod
    def of(cls, code: IFS, painted: Painted, seed: int) -> Coloured | None:
        """The code in the frame of the picture's canvas, with colours; None if hardly any pixel is lit in both."""
        coloured = fitted(code, painted, seed)
        if coloured is None:
            return None
        ground = tuple(painted.ground.clip(0, 1).tolist())
        drawn = on_ground(render(coloured, resolution=len(painted.seen), mode="colour"), ground).numpy()
        return cls(coloured, colour_error(coloured, painted, seed), np.hstack([painted.seen.clip(0, 1), drawn]))

    def beside(self, judgement: Judgement) -> Judgement:
        """The judgement with the colours' error among its scores, and the picture among its pictures."""
        error = {} if self.error is None else {"eval/ciede2000": self.error}
        return replace(judgement, scores=judgement.scores | error,
                       pictures=judgement.pictures | {"coloured": self.picture})


def check_method(class_path: str) -> None:
    """Raise `InputError` if a method, by the dotted path of its class, finds no code, or if scikit-image is missing."""
    for name, instead in WITHOUT_CODE.items():
        if name in class_path.split("."):
            raise InputError(f"colour=true gives colours to the maps of a code, and method={name} finds none: it "
                             f"{instead}; take another method, or leave colour out")
    need("skimage")


def of_target(target: Target) -> Painted:
    """The colours of a target's picture. Raises `InputError` if it is none, or a grey one."""
    if target.read.source is None:
        raise InputError("colour=true takes the colours of a picture, and this target is drawn without any; give "
                         "picture=FILE, or leave colour out")
    painted = Painted.of(target.read)
    if painted.is_grey:
        raise InputError(f"colour=true needs a picture in colour, and the shape in {target.read.source} is grey; "
                         "leave colour out, or give another picture")
    return painted
