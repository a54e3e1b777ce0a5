"""Parameters of the stages: rounds and image sizes."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from ....runtime.params import Amount, Count, Params, Share, check_order


class StageParams(Params):
    """Rounds and image sizes."""

    independent_rounds: Count = 4
    """Maximum number of rounds on a binary image. Each begins from nothing. 0: rounds continue from each other."""
    avoid_isometries: bool = True
    """Whether every other round avoids near-isometries: the first, third … of a picture that others drew, and of a
    binary image that may have more than one; the second, fourth … of another image, if a code with a near-isometry has
    failed."""
    second_round: Amount = 1.2
    """Noise ratio above which a second round begins."""
    hopeless: Amount = 0.4
    """Error of a rendering, radians rms, from which the image is assumed to show no attractor."""
    unlike: Share = 0.95
    """Likeness (F1 within 1 px) below which the code of a picture that others drew is not rounded, and another
    round begins."""
    largest_side: Annotated[int, Field(ge=64)] = 512
    """Maximum side, pixels, of the image that is searched. A larger one is shrunk."""
    full_side: Annotated[int, Field(ge=64)] = 1024
    """Maximum side, pixels, of the image on which the code of a larger one is polished at the end; at least
    `largest_side`."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        check_order(self, ("largest_side", "full_side"))
        return self
