"""The curve of likeness over the number of maps, for a picture of no code."""

from __future__ import annotations

import math
from functools import cached_property

from ....cameras.camera import Camera
from ....cameras.comparison import WITHIN_NOISE
from ....cameras.estimate import showing
from ....cameras.kinds import kind_of
from ....cameras.levels import may_be_density
from ....likeness import FEW_MAPS, share_inside
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..growth.descent import BLUR_PX, Found, descended
from ..growth.exposed import Exposed
from ..growth.paving import paving
from ..state import Candidate, Grown, WeightedMaps
from .base import SearchProblem


class Grower:
    """Sets of as many maps as asked for, that show the image of a search. on_the_way: the last set, and its mass."""

    def __init__(self, problem: SearchProblem, seed: int = 0):
        self.problem, self.seed, self.image = problem, seed, problem.image
        self.on_the_way: Found | None = None
        levels = problem.levels
        densities = [] if levels.is_exact else [kind for kind in levels.kinds if kind_of(kind).is_density]
        if densities:  # grown maps are drawn as a density wherever the image may have one
            levels = kind_of(densities[0])(levels.params, self.image, kinds=(densities[0],)).within(levels.known)
        self.levels, self.target = levels, Exposed.of(self.image, levels)

    def grown(self, count: int, deadline: Deadline = NO_DEADLINE, share: float = 1.0) -> Grown:
        """`count` maps that have moved together, for this share of the steps."""
        start = paving(self.target, count, derive(self.seed, "growth", count))
        steps = math.ceil(share * self.problem.params.growth.steps)
        return self._shown(*descended(start, self.target, steps, derive(self.seed, "growth", count), deadline,
                                      self._note))

    def unfinished(self) -> Grown | None:
        """The set whose growth was broken off, if there is one."""
        return self.on_the_way and self._shown(*self.on_the_way)

    def plain(self, count: int) -> Grown:
        """A plain paving by `count` maps."""
        maps = paving(self.target, count, derive(self.seed, "growth", count))
        return self._shown(maps, float(self.target.masses.sum()))

    @cached_property
    def is_grey(self) -> bool:
        """Whether grey levels say more than where the shape is."""
        return may_be_density(self.image)

    def likeness(self, found: WeightedMaps, camera: Camera) -> float:
        """How like the picture a code's drawing is, at most 1. Where the picture is grey inside, it is the SSIM inside
        the shape over what two drawings have by chance. Elsewhere, it is the F1 within a pixel."""
        objective = self.problem.objective(len(self.image), found.code, derive(self.seed, "likeness"), camera=camera)
        if not self.is_grey:
            shown = objective.judge(found.maps, found.weights)
            return objective.likeness(shown.image) if objective.levels.is_exact else objective.likeness_of(shown)
        drawn, again = objective.render(found.code), objective.render(found.code, "again")
        return max(0.0, min(1.0, share_inside(drawn, self.image, again, objective.levels.lit_above,
                                              objective.levels.known)))

    def is_explained_by(self, found: Candidate) -> bool:
        """Whether what the search found renders a density or a binary image of our own roughly, or explains any other
        picture to its noise by few maps, as many as are asked for. Few maps that are nearly right are worth more than
        many, which fit the noise of dots as well."""
        objective = self.problem.objective(len(self.image), found.code, derive(self.problem.seed, "found"),
                                           camera=self.problem.camera_of(found))
        shown = objective.judge(found.maps, found.weights)
        if self.problem.levels.is_exact:
            return not objective.is_hopeless(shown.error)
        are_few = len(found.maps) <= FEW_MAPS and self.problem.params.maps in (None, len(found.maps))
        return are_few and objective.noise_ratio(found.code, shown.image) < WITHIN_NOISE

    def _note(self, found: Found) -> None:
        self.on_the_way = found

    def _shown(self, maps: WeightedMaps, mass: float) -> Grown:
        """Maps with the camera that shows them, whose drawing has this mass."""
        camera = self._camera(maps, mass)
        return Grown(maps.maps, maps.weights, self.likeness(maps, camera), camera)

    def _camera(self, maps: WeightedMaps, mass: float) -> Camera:
        """That of the image if it is known. Else that of the exposure that was found, where the picture is grey, and
        elsewhere that which shows most of the shape."""
        levels, side, given = self.levels, self.target.side, self.problem.levels
        if given.is_exact or not levels.params.estimate:
            return given.camera
        if not levels.is_density:
            return showing(self.image, levels, maps.code, self.seed) or levels.camera
        blur = levels.params.blur_px
        found = Camera(levels.kind, gain=levels.params.gain or mass / side**2,
                       gamma=levels.curve.gamma if levels.is_curved else None,
                       blur=2 * (BLUR_PX / side if blur is None else blur / len(self.image)))
        return found if self.is_grey else showing(self.image, levels, maps.code, self.seed) or found
