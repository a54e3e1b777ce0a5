"""What all stages of a search share: what they are given, their time, and how they run.

What is given is the image, the meaning of its grey levels, the parameters and the deadline.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from torch import Tensor

from ....cameras.blur import blurred
from ....cameras.camera import Camera
from ....cameras.kinds import with_camera
from ....cameras.levels import Levels
from ....ifs.code import IFS
from ....runtime.deadline import NO_DEADLINE, Deadline
from ....runtime.seeds import derive
from ..image.objective import Frame, ImageObjective, reduced
from ..moves.search import ImageSearch
from ..moves.tools import Latest
from ..params import CollageParams
from ..state import Candidate, Key, State, WeightedMaps

EXACT_ROUNDS = 2        # on renderings, if rounds continue from each other
DRAWN_ROUNDS = 3        # on pictures that others drew
ROUND_SECONDS = 30.0    # in which a round finds something, on an image of at most ROUND_SIDE pixels per side
ROUND_SIDE = 256
SPLIT = 4               # by which a restart of a part of a shape is split: it finds maps in its first moves, or never
LATER_RESTARTS = 0.5    # share of the restarts, rounded up, in rounds that are not full
# Shares of a round's part of the time limit at which its moves end, and those of all later rounds
ROUND_ENDS = 0.95
BINARY_ROUND_ENDS = 0.85   # of a binary image that has a frame: this leaves time for the firm polishes in the frame
DRAWN_ROUND_ENDS = 0.8     # of a picture that others drew: this leaves time for the last stage
DRAWN_BLUR_PX = 3.0     # more in each later round: from afar, a construction that ended early looks like its attractor


@dataclass(frozen=True)
class Timetable:
    """When the parts of a search end. Each of the first rounds, `parts` of them, has an equal part of the time limit.
    Later rounds have what is left of the last part. round_ends: the share of a part at which a round ends."""

    limit: Deadline
    rounds: int
    parts: int
    round_ends: float

    def part_end(self, number: int, share: float = 1.0) -> Deadline:
        """When this share of a round's part has passed."""
        return self.limit.until((min(number, self.parts - 1) + share) / self.parts)

    def round_end(self, number: int) -> Deadline:
        """When the moves of a round end."""
        return self.part_end(number, self.round_ends)

    def stage_end(self, number: int, share: float | None) -> Deadline:
        """When a stage ends that has a share of its round's part, or, after all rounds, of the whole limit. None: it
        ends with its round, as all stages of rounds without a part do."""
        if share is None or self.parts <= number < self.rounds:
            return self.round_end(number)
        return self.limit.until(share) if number >= self.rounds else self.part_end(number, share)


@dataclass(frozen=True)
class SearchProblem:
    """The image `given` (R,R), what its grey levels mean, and all that a search of its code is given besides."""

    given: Tensor
    levels: Levels
    params: CollageParams
    seed: int = 0
    deadline: Deadline = NO_DEADLINE

    @cached_property
    def image(self) -> Tensor:
        """The image on which the search works: with at most `stages.largest_side` pixels per side."""
        side = len(self.given)
        size = side // math.ceil(side / self.params.stages.largest_side)
        return self.given if size == side else self.levels.shrunk(self.given, size)

    @cached_property
    def masses(self) -> Tensor:
        """The masses of the pixels of `image`."""
        return self.levels.measure(self.image)

    @property
    def full_side(self) -> int:
        """The side, pixels, on which the code of a larger image is polished at the end."""
        return min(len(self.given), self.params.stages.full_side)

    @property
    def is_reduced(self) -> bool:
        """Whether the search uses a smaller image than the given one."""
        return self.image is not self.given

    @property
    def is_crossed(self) -> bool:
        """Whether populations of sets replace stages 1 and 2."""
        few = 2 <= (self.params.maps or 0) <= self.params.population.most_maps
        return self.levels.is_linear and few and self.levels.known is None

    @cached_property
    def is_framed_firmly(self) -> bool:
        """Whether rounds end with polishes of the code in the frame of a binary image."""
        return Frame.firm_of(self.image, self.levels, self.params.frame) is not None

    @property
    def has_independent_rounds(self) -> bool:
        """Whether each round begins from nothing. The measure of a binary image often leads to a wrong code that draws
        it well, and a round that begins with the maps of such a code ends with them."""
        return self.levels.is_exact and not self.levels.is_graded and self.params.stages.independent_rounds > 0

    @property
    def rounds(self) -> int:
        """Maximum number of rounds."""
        exact = self.params.stages.independent_rounds if self.has_independent_rounds else EXACT_ROUNDS
        usual = 1 if self.is_crossed else exact if self.levels.is_exact else DRAWN_ROUNDS
        return self.params.rounds or usual

    @property
    def full_rounds(self) -> int:
        """Number of rounds that have all restarts, and equal parts of the time limit. Later rounds have fewer restarts,
        and the time that is left. Parts are at least as long as a round needs on an image of this size."""
        if not self.has_independent_rounds:
            return 1
        seconds = ROUND_SECONDS * max(1.0, (len(self.image) / ROUND_SIDE) ** 2)
        limit = self.deadline.seconds
        return self.rounds if limit is None else max(1, int(min(self.rounds, limit / seconds)))

    @cached_property
    def times(self) -> Timetable:
        """When rounds and stages end."""
        exact = BINARY_ROUND_ENDS if self.is_framed_firmly else ROUND_ENDS
        return Timetable(self.deadline, self.rounds, self.full_rounds,
                         exact if self.levels.is_exact else DRAWN_ROUND_ENDS)

    @property
    def split(self) -> int:
        """The number of short restarts that share the moves of one."""
        return 1 if self.levels.known is None else SPLIT

    def restarts(self, number: int) -> int:
        """Number of restarts in a round."""
        restarts = self.split * self.params.search.restarts
        return restarts if number < self.full_rounds else math.ceil(restarts * LATER_RESTARTS)

    def masses_of(self, number: int, measured_through: Camera | None = None) -> Tensor:
        """The masses (R,R) on which a round searches, read from the image through a camera."""
        masses = self.masses
        if measured_through:
            levels = with_camera(self.levels, measured_through)  # which also say how the image is shrunk
            masses = levels.measure(levels.shrunk(self.given, len(self.image)) if self.is_reduced else self.given)
        return masses if self.levels.is_exact else blurred(masses, number * DRAWN_BLUR_PX)

    def camera(self, code: IFS, measured_through: Camera | None = None) -> Camera:
        """The camera of the image, estimated from a nearly right code, once for each code; the one that is known if the
        levels are exact. measured_through: the camera through which the search reads masses."""
        if self.levels.is_exact:
            return self.levels.camera
        from ....cameras.estimate import estimated  # for other pictures alone

        key = measured_through, *_bytes_of(code)
        if key not in self._cameras:
            levels = with_camera(self.levels, measured_through)
            found = estimated(self.image, levels, code, derive(self.seed, "camera"))
            self._cameras[key] = found or self.levels.camera
        return self._cameras[key]

    def angle_as_density(self, code: IFS) -> float:
        """The least angle of error between the image and the density of a code, computed once for each code."""
        from ....cameras.estimate import angle_as_density

        key = tuple(_bytes_of(code))
        if key not in self._angles:
            self._angles[key] = angle_as_density(self.image, self.levels, code, derive(self.seed, "as density"))
        return self._angles[key]

    def camera_of(self, found: Candidate) -> Camera:
        """The camera of a candidate; one that has none yet, as where a search is cut short, gets the estimate."""
        return found.camera or self.camera(found.code)

    @cached_property
    def _cameras(self) -> dict[tuple[object, ...], Camera]:
        """The cameras estimated so far, by all that they depend on: several stages ask for that of the same code."""
        return {}

    @cached_property
    def _angles(self) -> dict[tuple[bytes, ...], float]:
        return {}

    def objective(self, size: int, code: IFS, seed: int, renderings: int = 1,
                  camera: Camera | None = None) -> ImageObjective:
        """The objective at this image size. `code` is the best so far, `camera` the camera that renders it."""
        image, levels = self.given, with_camera(self.levels, camera)
        if size != image.shape[0]:
            image = reduced(image, size, code, levels, self.params, seed)
        return ImageObjective(image, levels, self.params, seed, renderings)

    @cached_property
    def noise_ratio(self) -> Latest[float]:
        """Of a candidate: the error of its maps, drawn with tied weights, relative to that of the true code."""
        return Latest(self._noise_ratio)

    def _noise_ratio(self, found: WeightedMaps) -> float:
        objective = self.objective(len(self.image), found.code, derive(self.seed, "near"))
        shown = objective.judge(found.maps)
        return shown.error / objective.noise(shown.code)

    def image_search(self, code: IFS, deadline: Deadline, *path: str | int,
                     camera: Camera | None = None, measured_through: Camera | None = None) -> ImageSearch:
        """The search by renderings, at the size of the problem's image. `code` is the best so far; without a camera,
        the one that suits the code best is estimated."""
        seed = derive(self.seed, *path)
        camera = self.camera(code, measured_through) if camera is None else camera
        objective = self.objective(len(self.image), code, seed, camera=camera)
        seen, kind = objective.levels, ImageSearch
        masses = seen.measure(objective.image) if self.is_reduced or seen.is_density else self.masses
        if not self.levels.is_exact:
            from ..moves.drawn import DrawnSearch  # for other pictures alone

            kind = DrawnSearch
        return kind(objective, masses, noise=objective.noise(code), seed=seed, deadline=deadline)


def _bytes_of(code: IFS) -> list[bytes]:
    """All numbers of a code, to tell it from others."""
    return [each.cpu().numpy().tobytes() for each in (code.linear, code.offset, code.probabilities) if each is not None]


class Stage(ABC):
    """One stage of a search.

    It is asked whether it is wanted, opened, moved as long as it has moves and time and is not settled, and closed.
    Asking changes nothing. What is opened, moved or closed returns the search's next state; `state.current` is its
    candidate. A stage whose `current` is there already when it is opened is resumed.

    name: shown in reports; part: its name in `STAGES`, where it is not the same; ends_at: the share of its time at
    which it ends, see `Timetable.stage_end`; ends_at_once: whether it is cut short when the search's time is up and
    there is a code already, however far it is; is_last_word: whether it runs even if the search has ended in favour of
    grown maps. A stage that has not begun by `latest_start` is skipped.
    """

    name: str
    part: str = ""
    ends_at: float | None = None
    is_last_word = False
    ends_at_once: bool = False
    search: Any

    def __init__(self, problem: SearchProblem, number: int = 0, restart: float = 0):
        self.problem, self.params, self.round, self.restart = problem, problem.params, number, restart

    @property
    def key(self) -> Key:
        """Unique key of the stage."""
        return Key(self.round, self.part or self.name, self.restart)

    @property
    def expected_moves(self) -> int:
        """Expected number of moves."""
        return 0

    @property
    def most_moves(self) -> int:
        """Maximum number of moves."""
        return self.expected_moves

    @property
    def deadline(self) -> Deadline:
        """When the stage ends."""
        return self.problem.times.stage_end(self.round, self.ends_at)

    @property
    def latest_start(self) -> Deadline:
        """When it is too late for the stage to begin."""
        return self.deadline

    def is_wanted(self, state: State) -> bool:
        """Whether the stage has anything to do, after what the stages before it have found."""
        return True

    @abstractmethod
    def open(self, state: State) -> State:
        """Prepare the stage; the state with the candidate that it starts with."""

    def move(self, state: State) -> State:
        """The state after one more move: a step of the stage's search, where it has one."""
        return state.moved(self.search.step(state.now, state.step))

    def is_settled(self, state: State) -> bool:
        """Whether further moves are unnecessary or hopeless."""
        return False

    def cut_short(self, state: State) -> State:
        """The state that the stage hands on if it ends in the midst of its moves, because time is up or somebody
        interrupts it; as it is if the stage has found nothing to hand on."""
        return state

    def close(self, state: State) -> State:
        """The state that the stage hands on."""
        return replace(state, best=state.current)
