"""The parameters of collage search, a class a component. docs/collage.md says where each stands in the method.

A component's class lies in the `params.py` of its folder. Where a docstring names no source, the value was found by
trial on tuning suites (docs/lab_notes.md). A part is switched off by its own setting: `enabled=false`, a count of 0,
odds of 0.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from ...runtime.params import NAME, Amount, Count, ParamError, Params, Positive, Share, as_yaml
from .canonical.params import CanonicalParams
from .fields import SingularValue
from .growth.params import GrowthParams
from .image.params import FrameParams, GaussNewtonParams, ImageParams, LineParams, MoveParams, RefineParams
from .measure.params import BirthParams, CameraParams, DescentParams, PopulationParams, SaturationParams, SearchParams

BYTES_OF_A_MAP = 12   # six numbers of 16 bits


class StageParams(Params):
    """Rounds, sizes and shares of time."""

    density_rounds: Positive = 4
    """Rounds at most, where grey levels are a density."""
    other_rounds: Positive = 2
    """Rounds at most on other images: it is less likely that they show an attractor."""
    drawn_rounds: Positive = 3
    """The same of pictures that others drew."""
    drawn_blur_px: Amount = 3.0
    """In each later round their measure is blurred by so many pixels more: a construction that ended early looks like
    its attractor from afar."""
    second_round: Amount = 1.2
    """Noise ratio above which a second round begins,"""
    later_rounds: Amount = 2.0
    """and a third and a fourth."""
    hopeless: Amount = 0.4
    """Error of a rendering, radians rms, from which on the image is taken to show no code's attractor."""
    avoid_isometries: bool = True
    """Whether every other round keeps clear of near-isometries, if a code with one has failed."""
    unlike: Share = 0.95
    """F1 within 1 px below which the code of a picture that others drew is worth another round, and no rounding."""
    drawn_hopeless: Share = 0.7
    """F1 within 1 px below which such a picture shows no code, and no other round is worth its time."""
    isometry: Share = 0.95
    """Smaller singular value above which a map is a near-isometry,"""
    contraction: SingularValue = 0.9
    """and the largest one that such a round allows."""
    largest_side: Annotated[int, Field(ge=64)] = 512
    """Side in pixels of the image that is searched; a larger one is shrunk."""
    full_side: Annotated[int, Field(ge=64)] = 1024
    """Side in pixels, at most, of the image on which the code of a larger one is polished in the end; at least
    `largest_side`."""
    full_polish: Count = 4
    """Gauss-Newton steps on it."""
    search_share: Share = 0.35
    """Share of a limited time at which the restarts of the first round end,"""
    mixture_share: Share = 0.45
    """the search from their mixture,"""
    detail_share: Share = 0.65
    """stage 2,"""
    approach_share: Share = 0.75
    """the polish of a shrunk image,"""
    hopeless_share: Share = 0.75
    """the moves of stage 3 where the code is hopeless, so that time is left for growth,"""
    image_share: Share = 0.95
    """stage 3 and all later rounds,"""
    full_share: Share = 0.98
    """the polish at full size,"""
    canonical_share: Share = 0.99
    """and from which on the last digits are left as they are."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for first, second in (*pairwise(name for name in type(self).model_fields if name.endswith("_share")),
                              ("largest_side", "full_side")):
            low, high = getattr(self, first), getattr(self, second)
            if low > high:
                raise ParamError(second, f"{NAME} must be at least {first}, which is {low}; got {high}")
        return self


class CollageParams(Params):
    """All parameters of collage search."""

    maps: Annotated[int, Field(ge=2)] | None = None
    """Number of maps; null: found."""
    at_most: Annotated[int, Field(ge=2)] | None = None
    """Upper bound of the number of maps; null: no bound."""
    likeness: Annotated[float, Field(gt=0, le=1)] | None = None
    """F1 within a pixel that is to be reached, by as few maps of the curve as can be; null: as `growth` says."""
    bytes: Annotated[int, Field(ge=24)] | None = None
    """Bytes that the code may take, 12 for each map (six numbers of 16 bits); null: no bound."""
    rounds: Positive | None = None
    """Rounds at most; null: as `stages` says for the meaning of the grey levels."""
    levels: Literal["auto", "density", "linear", "dots", "coverage", "binary"] = "auto"
    """What grey levels mean: the share of subpixels that a chaos game hits, the number of its points in a pixel up to a
    factor, the ink of as many dots, the covered share of a pixel, or nothing (black and white). `auto` takes what our
    own renderer did not draw for coverage, and dots if these explain it better in the end."""
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

    @property
    def most_maps(self) -> int | None:
        """The upper bound of the number of maps, if there is one."""
        return self.bytes // BYTES_OF_A_MAP if self.bytes else self.at_most

    @property
    def grows_at_once(self) -> bool:
        """Whether so many maps are asked for that no search is worth while."""
        asked = self.maps or (self.bytes or 0) // BYTES_OF_A_MAP
        return self.growth.enabled and asked >= self.growth.at_once


def hydra_config() -> str:
    """conf/method/collage.yaml: `python -m fractal_exp.methods.collage.params > conf/method/collage.yaml`."""
    elsewhere = {"rounds": "${rounds}", "search.restarts": "${restarts}", "search.moves": "${moves}",
                 "search.detail_moves": "${detail_moves}", "moves.count": "${image_moves}"}
    return f"""# Collage search: the maps of a code, found one by one from the measure that the image shows.
# Made from fractal_exp/methods/collage/params.py, which states every parameter once; do not edit it here.
_target_: fractal_exp.methods.collage.method.Collage
_convert_: all
seconds: ${{seconds}}
seed: ${{seed}}
device: ${{device}}
previews: 10
{as_yaml(CollageParams(), elsewhere)}
"""


if __name__ == "__main__":
    print(hydra_config(), end="")
