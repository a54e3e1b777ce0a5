"""Parameters of the stages: rounds, image sizes and shares of the time limit."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Self

from pydantic import Field, model_validator

from ....runtime.params import Amount, Count, Params, Positive, Share, check_order
from .fields import PositiveShare, SingularValue


class StageParams(Params):
    """Rounds, image sizes and shares of the time limit."""

    density_rounds: Positive = 4
    """Maximum number of rounds where grey levels are a density."""
    independent_rounds: Count = 4
    """Maximum number of rounds on a binary image. Each begins from nothing. 0: rounds continue from each other."""
    round_seconds: Annotated[float, Field(ge=1)] = 30.0
    """Minimum length, seconds, of the parts into which a time limit is divided, one for each independent round. It
    grows in proportion to the pixels of an image beyond 256²."""
    other_rounds: Positive = 2
    """Maximum number of rounds on a binary image if rounds continue from each other."""
    drawn_rounds: Positive = 3
    """Maximum number of rounds on pictures that others drew."""
    drawn_blur_px: Amount = 3.0
    """Each later round blurs the measure of such a picture by this many more pixels: from afar, a construction that
    ended early looks like its attractor."""
    second_round: Amount = 1.2
    """Noise ratio above which a second round begins."""
    later_rounds: Amount = 2.0
    """Noise ratio above which a third or fourth round begins."""
    hopeless: Amount = 0.4
    """Error of a rendering, radians rms, from which the image is assumed to show no attractor."""
    later_restarts: PositiveShare = 0.5
    """Restarts of each later round that continues from earlier ones, or for which a time limit has no part of its own;
    as a share of `search.restarts`, rounded up."""
    avoid_isometries: bool = True
    """Whether every other round avoids near-isometries: the first, third … of a picture that others drew, and of a
    binary image that may have more than one; the second, fourth … of another image, if a code with a near-isometry has
    failed."""
    unlike: Share = 0.95
    """Likeness (F1 within 1 px) below which the code of a picture that others drew is not rounded, and another
    round begins."""
    drawn_hopeless: Share = 0.7
    """Likeness below which such a picture is assumed to show no code, and no other round begins."""
    isometry: Share = 0.95
    """Smaller singular value above which a map counts as a near-isometry."""
    contraction: SingularValue = 0.9
    """Upper limit of the smaller singular value in rounds that avoid near-isometries."""
    largest_side: Annotated[int, Field(ge=64)] = 512
    """Maximum side, pixels, of the image that is searched. A larger one is shrunk."""
    full_side: Annotated[int, Field(ge=64)] = 1024
    """Maximum side, pixels, of the image on which the code of a larger one is polished at the end; at least
    `largest_side`."""
    full_polish: Count = 4
    """Gauss-Newton steps on that image."""
    search_share: Share = 0.35
    """Share of the time limit at which the restarts of the first round end. For independent rounds, this share and
    those up to `image_share`, except `hopeless_share`, are of the part of the time that a round has."""
    mixture_share: Share = 0.45
    """Share at which the search from their mixture ends."""
    detail_share: Share = 0.65
    """Share at which stage 2 ends."""
    approach_share: Share = 0.75
    """Share at which the polish on a shrunk image ends."""
    hopeless_share: Share = 0.75
    """Share at which the moves of stage 3 end if the code is hopeless. This leaves time for growth."""
    drawn_image_share: Share = 0.8
    """Share at which stage 3 and all later rounds end on a picture that others drew. This leaves time for rounding."""
    binary_image_share: Share = 0.85
    """Share at which stage 3 and all later rounds end on a binary image that has a frame. This leaves time for the firm
    polishes in this frame."""
    image_share: Share = 0.95
    """Share at which stage 3 and all later rounds end on other images."""
    full_share: Share = 0.98
    """Share at which the polish at full size ends."""
    rounding_share: Share = 0.99
    """Share from which codes are not rounded."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        shares = [name for name in type(self).model_fields if name.endswith("_share")]
        for kind in ("drawn_image_share", "binary_image_share"):     # alternatives to image_share
            shares.remove(kind)
            check_order(self, ("hopeless_share", kind), (kind, "image_share"))
        check_order(self, *pairwise(shares), ("largest_side", "full_side"), ("drawn_hopeless", "unlike"),
                    ("contraction", "isometry"))
        return self
