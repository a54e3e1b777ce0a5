"""Where target images come from: classic codes, the random suite, pictures."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

from torch import Tensor

from . import codes, suite
from .errors import InputError
from .ifs.code import IFS
from .images import reading as images
from .images import samples
from .images.checks import Frame
from .images.levels import Levels, meaning_of

Kind = Literal["grey", "binary"]
MEANINGS: dict[Kind, str] = {"grey": "density", "binary": "binary"}   # of the levels of drawn targets, by kind


@dataclass(frozen=True)
class Target:
    """An image to invert, as it was read or drawn, and the code that drew it, if known."""

    read: images.ReadImage
    truth: IFS | None = None

    @classmethod
    def drawn(cls, code: IFS, resolution: int, kind: Kind = "grey", notes: Sequence[str] = ()) -> Target:
        """The target (resolution, resolution) that our renderer draws of a code, whose truth is that code."""
        image = suite.target(code, resolution, kind)
        return cls(images.ReadImage.of_drawing(image, MEANINGS[kind], tuple(notes)), code)

    @property
    def image(self) -> Tensor:
        """(R,R) in [0,1]."""
        return self.read.image


class TargetSource(ABC):
    """A target that is read or drawn when the resolution is known. `label` names it in folders and tables."""

    label: str

    @abstractmethod
    def load(self, resolution: int) -> Target:
        """The target at (resolution, resolution). Raises `InputError` if it cannot be read or used."""


def _sample(image: Tensor, note: str) -> Target:
    return Target(images.ReadImage.of_drawing(image, meaning_of(image), (note,)))


class KnownCode(TargetSource):
    """A classic code by name (see `fractal_exp.codes`), drawn grey or binary.

    probabilities of its maps: "area" for |det| + 0.01, as for the random suite, or "published" for those of its source.
    Raises `InputError` if the source gives none.
    """

    def __init__(self, name: str = "fern", kind: Kind = "grey",
                 probabilities: Literal["area", "published"] = "area"):
        published = codes.known(name)
        if probabilities == "published" and published.probabilities is None:
            raise InputError(f"the source of {name!r} gives no probabilities; take target.probabilities=area")
        self.code = published if probabilities == "published" else replace(published, probabilities=None)
        self.kind: Kind = kind
        self.label = name if probabilities == "area" else f"{name}-{probabilities}"
        self.notes = (published.meta["title"], f"probabilities: {probabilities}")

    def load(self, resolution: int) -> Target:
        return Target.drawn(self.code, resolution, self.kind, self.notes)


class SuiteFractal(TargetSource):
    """Fractal `index` of the random suite of this seed, drawn grey or binary."""

    def __init__(self, index: int = 0, seed: int = suite.SUITE_SEED, kind: Kind = "grey"):
        if index < 0:
            raise InputError(f"a suite's fractals are numbered from 0, got index {index}")
        self.code = suite.random_suite(index + 1, seed)[index]
        self.kind: Kind = kind
        self.label = f"suite{seed}-{index:03d}"

    def load(self, resolution: int) -> Target:
        return Target.drawn(self.code, resolution, self.kind, (f"{len(self.code)} maps",))


class Picture(TargetSource):
    """An image file. Its shape is found, centred and padded, see `fractal_exp.images.read_target`."""

    def __init__(self, path: str, invert: bool | Literal["auto"] = "auto", threshold: float | None = None,
                 clean: bool = True, crop: Sequence[int] | None = None, levels: Levels = "auto",
                 frame: Frame = "fit"):
        self.levels: Levels = levels
        self.frame: Frame = frame
        self.path, self.threshold, self.clean, self.crop = Path(path).absolute(), threshold, clean, crop
        self.invert: bool | Literal["auto"] = invert
        self.label = self.path.stem

    def load(self, resolution: int) -> Target:
        return Target(images.read_target(self.path, resolution, invert=self.invert, threshold=self.threshold,
                                         clean=self.clean, crop=self.crop, levels=self.levels, frame=self.frame))


class RetinaVessels(TargetSource):
    """The blood vessels of scikit-image's photograph of a retina."""

    label = "retina"

    def load(self, resolution: int) -> Target:
        return _sample(samples.retina_vessels(resolution), "blood vessels of skimage.data.retina()")


class Snowflake(TargetSource):
    """The snowflake of the font DejaVu Sans."""

    label = "snowflake"

    def load(self, resolution: int) -> Target:
        return _sample(samples.snowflake(resolution), "snowflake of the font DejaVu Sans")
