"""What all stages of a search share: the image, the meaning of its grey levels, the parameters, the deadline."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

from torch import Tensor

from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..camera.blur import blurred
from ..camera.levels import Levels
from ..camera.tones import Camera, seen_with
from ..image.camera import estimated
from ..image.frame import Frame
from ..image.objective import ImageObjective, reduced
from ..maps import WeightedMaps
from ..moves.search import ImageSearch
from ..params import CollageParams
from ..simplify.doubles import without_doubles

ROUND_SIDE = 256   # maximum side, pixels, of an image to which `StageParams.round_seconds` applies as it is


@dataclass(frozen=True)
class SearchProblem:
    """The image `given` (R,R). The search uses a version of it, `image`, with at most `stages.largest_side` pixels per
    side, and its `masses`. `full_side` is the side on which the code of a larger image is polished."""

    given: Tensor
    levels: Levels
    params: CollageParams
    seed: int = 0
    deadline: Deadline = NO_DEADLINE
    image: Tensor = field(init=False)
    full_side: int = field(init=False)
    masses: Tensor = field(init=False)

    def __post_init__(self) -> None:
        side, stages = self.given.shape[0], self.params.stages
        size = side // math.ceil(side / stages.largest_side)
        image = self.given if size == side else self.levels.shrunk(self.given, size)
        object.__setattr__(self, "image", image)
        object.__setattr__(self, "full_side", min(side, stages.full_side))
        object.__setattr__(self, "masses", self.levels.measure(image))

    @property
    def rounds(self) -> int:
        """Maximum number of rounds."""
        stages = self.params.stages
        other = stages.independent_rounds if self.has_independent_rounds else stages.other_rounds
        most = 1 if self.is_crossed else stages.density_rounds if self.levels.is_density else other
        return self.params.rounds or (most if self.levels.is_exact else stages.drawn_rounds)

    @property
    def is_crossed(self) -> bool:
        """Whether populations of sets replace stages 1 and 2."""
        return self.levels.is_linear and 2 <= (self.params.maps or 0) <= self.params.population.most_maps

    @cached_property
    def is_framed_firmly(self) -> bool:
        """Whether rounds end with polishes of the code in the frame of a binary image."""
        return Frame.firm_of(self.image, self.levels, self.params.frame) is not None

    @property
    def image_share_name(self) -> str:
        """The name in `StageParams` of the share at which stage 3 and later rounds end on such an image."""
        if not self.levels.is_exact:
            return "drawn_image_share"
        return "binary_image_share" if self.is_framed_firmly else "image_share"

    @property
    def has_independent_rounds(self) -> bool:
        """Whether each round begins from nothing. The measure of a binary image often leads to a wrong code that draws
        it well, and a round that begins with the maps of such a code ends with them."""
        return self.levels.is_exact and not self.levels.is_graded and self.params.stages.independent_rounds > 0

    @property
    def full_rounds(self) -> int:
        """Number of rounds that have all restarts, and equal parts of the time limit. Later rounds have fewer restarts,
        and the time that is left."""
        if not self.has_independent_rounds:
            return 1
        seconds = self.params.stages.round_seconds * max(1.0, (len(self.image) / ROUND_SIDE) ** 2)
        limit = self.deadline.seconds
        return self.rounds if limit is None else max(1, int(min(self.rounds, limit / seconds)))

    def masses_of(self, number: int, measured_through: Camera = ()) -> Tensor:
        """The masses (R,R) on which a round searches, read from the image through a camera."""
        sigma = 0 if self.levels.is_exact else number * self.params.stages.drawn_blur_px
        masses = self._masses(seen_with(self.levels, measured_through)) if measured_through else self.masses
        return blurred(masses, sigma, self.params.camera)

    def _masses(self, levels: Levels) -> Tensor:
        """The masses (R,R) of the image by other levels, which also say how it is shrunk."""
        return levels.measure(levels.shrunk(self.given, len(self.image)) if self.is_reduced else self.given)

    def restarts(self, number: int) -> int:
        """Number of restarts in a round."""
        restarts = self.params.search.restarts
        return restarts if number < self.full_rounds else math.ceil(restarts * self.params.stages.later_restarts)

    @property
    def is_reduced(self) -> bool:
        """Whether the search uses a smaller image than the given one."""
        return self.image is not self.given

    def camera(self, code: IFS, seed: int, measured_through: Camera = ()) -> Camera:
        """The camera of the image, estimated from a nearly right code; empty if the levels are exact.
        measured_through: the camera through which the search reads masses."""
        return estimated(self.image, seen_with(self.levels, measured_through), code, self.params, seed)

    def objective(self, size: int, code: IFS, seed: int, renderings: int = 1, camera: Camera = ()
                  ) -> ImageObjective:
        """The objective at this image size. `code` is the best so far, `camera` the camera that renders it."""
        image, levels = self.given, seen_with(self.levels, camera)
        if size != image.shape[0]:
            image = reduced(image, size, code, levels, self.params, seed)
        return ImageObjective(image, levels, self.params, seed, renderings)

    def image_search(self, code: IFS, deadline: Deadline, *path: str | int,
                     camera: Camera | None = None, measured_through: Camera = ()) -> ImageSearch:
        """The search by renderings, at the size of the problem's image. `code` is the best so far; without a camera,
        the one that suits the code best is estimated."""
        seed = derive(self.seed, *path)
        camera = self.camera(code, seed, measured_through) if camera is None else camera
        objective = self.objective(len(self.image), code, seed, camera=camera)
        seen = objective.levels
        masses = seen.measure(objective.image) if self.is_reduced or seen.is_density else self.masses
        return ImageSearch(objective, masses, noise=objective.noise(code), seed=seed, deadline=deadline)

    def without_doubles(self, found: WeightedMaps) -> WeightedMaps:
        """The code without its doubles."""
        return without_doubles(found, self.params, len(self.image), self.seed)
