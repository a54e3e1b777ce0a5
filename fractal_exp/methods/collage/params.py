"""The parameters of collage search, one class per component. docs/collage.md explains where the method uses each.

The class of a component is in the `params.py` of its folder, the camera's in `measure/camera_params.py`. Where a
docstring names no source, the value was found by trial on tuning suites (docs/lab_notes.md). Each part has a setting
that switches it off: `enabled=false` or another switch, a count of 0, odds of 0.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ...runtime.params import NAME, Amount, Count, ParamError, Params, Positive, Share, as_yaml, check_order
from .canonical.params import CanonicalParams
from .fields import PositiveShare, SingularValue
from .growth.params import GrowthParams
from .image.params import FrameParams, GaussNewtonParams, ImageParams, LineParams, MoveParams, RefineParams
from .measure.camera_params import CameraParams
from .measure.params import BirthParams, DescentParams, PopulationParams, SaturationParams, SearchParams

BYTES_OF_A_MAP = 12   # six numbers of 16 bits
ROUND_SIDE = 256   # maximum side, pixels, of an image to which `StageParams.round_seconds` applies as it is
CAMERAS = {   # values of the camera, with the levels that they are of
    "pen_px": ("coverage",), "gain": ("dots", "tonemapped"), "gamma": ("tonemapped",),
    "blur_px": ("coverage", "dots", "tonemapped", "linear"),
}


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
    """Share at which stage 3 and all later rounds end on a picture that others drew. This leaves time for stage 4."""
    binary_image_share: Share = 0.85
    """Share at which stage 3 and all later rounds end on a binary image that has a frame. This leaves time for the firm
    polishes in this frame."""
    image_share: Share = 0.95
    """Share at which stage 3 and all later rounds end on other images."""
    full_share: Share = 0.98
    """Share at which the polish at full size ends."""
    canonical_share: Share = 0.99
    """Share from which the last digits are left as they are."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        shares = [name for name in type(self).model_fields if name.endswith("_share")]
        for kind in ("drawn_image_share", "binary_image_share"):     # alternatives to image_share
            shares.remove(kind)
            check_order(self, ("hopeless_share", kind), (kind, "image_share"))
        check_order(self, *pairwise(shares), ("largest_side", "full_side"), ("drawn_hopeless", "unlike"),
                    ("contraction", "isometry"))
        return self


class CollageParams(Params):
    """All parameters of collage search."""

    maps: Annotated[int, Field(ge=2)] | None = None
    """Number of maps; null: the search finds it."""
    at_most: Annotated[int, Field(ge=2)] | None = None
    """Maximum number of maps; null: no limit."""
    likeness: Annotated[float, Field(gt=0, le=1)] | None = None
    """F1 within a pixel that growth must reach, with as few maps of the curve as possible; null: see `growth`."""
    bytes: Annotated[int, Field(ge=24)] | None = None
    """Maximum size of the code, bytes: 12 for each map (six numbers of 16 bits); null: no limit."""
    rounds: Positive | None = None
    """Maximum number of rounds; null: `stages` says, depending on what grey levels mean."""
    levels: Literal["auto", "density", "linear", "dots", "tonemapped", "coverage", "binary"] = "auto"
    """What grey levels mean: the share of subpixels that the chaos game hits, the number of its points in a pixel
    up to a factor, the ink of as many dots, such a number through a tone curve (gamma or logarithm), the covered share
    of a pixel, or nothing (black and white). `auto` takes images that our renderer did not draw as coverage, or as
    dots or a tone-mapped density if those explain them better."""
    search: SearchParams = SearchParams()
    population: PopulationParams = PopulationParams()
    births: BirthParams = BirthParams()
    descent: DescentParams = DescentParams()
    saturation: SaturationParams = SaturationParams()
    refine: RefineParams = RefineParams()
    camera: CameraParams = CameraParams()
    image: ImageParams = ImageParams()
    moves: MoveParams = MoveParams()
    lines: LineParams = LineParams()
    gauss_newton: GaussNewtonParams = GaussNewtonParams()
    frame: FrameParams = FrameParams()
    canonical: CanonicalParams = CanonicalParams()
    growth: GrowthParams = GrowthParams()
    stages: StageParams = StageParams()

    @model_validator(mode="after")
    def _one_number_of_maps(self) -> Self:
        given = [f"{name}={value}" for name in ("maps", "at_most", "likeness", "bytes")
                 if (value := getattr(self, name)) is not None]
        if len(given) > 1:
            raise ValueError("give one of the number of maps (maps), its upper bound (at_most or bytes) and the "
                             f"likeness to be reached, not two; got {' and '.join(given)}")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        camera = self.camera
        if self.likeness is not None and not self.growth.enabled:
            raise ParamError("likeness", f"{NAME} is reached by growth, but growth.enabled is false; "
                                         f"got {self.likeness}")
        for name, levels in CAMERAS.items():
            value = getattr(camera, name)
            if value is not None and self.levels not in ("auto", *levels):
                raise ParamError(f"camera.{name}", f"{NAME} must be null if levels is {self.levels}, got {value}")
        if not self.camera_kinds:
            raise ParamError("camera.pen_px", f"{NAME} must be null if camera.gain or camera.gamma is given, which "
                                              f"are of dots, not of lines and areas; got {camera.pen_px}")
        if camera.blur_px is not None and not camera.estimate and self.levels != "linear":
            raise ParamError("camera.blur_px", f"{NAME} must be null if camera.estimate is false and levels is not "
                                               f"linear, got {camera.blur_px}")
        return self

    @property
    def camera_kinds(self) -> tuple[str, ...]:
        """The levels that a picture may have that others drew: those asked for, or, if `levels` is `auto`, those that
        have all the values of the camera that the user knows."""
        if self.levels != "auto":
            return (self.levels,)
        known = [kinds for name, kinds in CAMERAS.items() if getattr(self.camera, name) is not None]
        return tuple(kind for kind in ("coverage", "dots", "tonemapped") if all(kind in kinds for kinds in known))

    @property
    def most_maps(self) -> int | None:
        """The maximum number of maps, or None."""
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether the user asks for so many maps that growth starts without a search."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once


def hydra_config() -> str:
    """conf/method/collage.yaml: `python -m fractal_exp.methods.collage.params > conf/method/collage.yaml`."""
    return f"""# Collage search finds the maps of a code one by one, from the measure that the image shows.
# This file is generated from the parameter classes in fractal_exp/methods/collage. Do not edit it.
_target_: fractal_exp.methods.collage.method.Collage
_convert_: all
seconds: ${{seconds}}
seed: ${{seed}}
device: ${{device}}
previews: 10
{as_yaml(CollageParams(), {})}
"""


if __name__ == "__main__":
    print(hydra_config(), end="")
