"""A drawing of a recursion that ended after few steps: found as few maps, and seen as tiles or strokes."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

from ....cameras.blur import blurred
from ....cameras.camera import KNOWN, LENGTHS
from ....cameras.kinds import with_camera
from ....cameras.pens import Inked
from ....cameras.strokes import Strokes, flat_maps
from ....likeness import ALIKE, TILED_MAPS, UNLIKE
from ....runtime.seeds import derive
from ..image.camera import MOST_MAPS, STROKED, Fit, angle_of, in_turns, polish_under
from ..image.objective import ImageObjective, Rendered
from ..measure.search import MeasureSearch, Regime
from ..simplify.loop import Price
from ..state import Candidate, State
from ..trees.registration import Registration
from ..trees.trunk import with_trunk
from .base import SearchProblem, Stage

ENDS = 0.75             # share of the time limit at which the stage ends
TILES, STROKES = Inked.kind, Strokes.kind  # tiles are coverage with a tile size above 0; without one it is a pen
LEAST_TREE = 3         # maps: a trunk and two branches
BELOW = 0.985          # likeness of a code, or of strokes, below which a construction, or another one, is sought
BRANCHES = 4, 3, 2     # most maps in each search for branches; the first one comes before those for tiles
BLURS_PX = 3.0, 6.0    # of the measure, in searches for few maps that are then seen as tiles
CONTRACTION = 0.75     # limit of smaller singular values: a mirrored copy of the whole tree is no branch
TRUNK_STROKES = 4      # that take the place of a code's flat maps at most
REGISTERED_KEPT = 2    # registered codes, those at the likeliest depths, that are then seen as strokes
COARSE_SIDE = 128      # pixels of the image on which strokes are polished first, at most
GAIN = 0.3             # strokes go on to the whole image if their squared angle is at most this share of the maps'
DRAWN_ALIKE = 0.9      # least F1 within a pixel of a drawing by strokes that is taken


@dataclass(frozen=True)
class _Try:
    """A search for at most so many maps on the measure, blurred (pixels), and the camera that its code is seen with."""

    maps: int
    blur_px: float
    camera: str


class Construction(Stage):
    """Searches for few maps, each looked at as tiles or as strokes.

    A dragon or a tree of few levels is a lattice of lines. Many maps explain it better than its true code does, unless
    it is known that the construction ends. From afar it looks like its attractor, so few maps (`TILED_MAPS`) are
    searched for on a blurred measure, and seen as tiles. A tree has a trunk too, which is what its branches leave over.
    It is seen as strokes, at the depth that suits the drawing. The code is taken if it draws the picture; the moves by
    renderings are then left out. Two maps that a pen draws are taken if they are the simpler code; the moves by
    renderings then go on from them. A move of this stage is a search.
    """

    name, ends_at = "construction", ENDS
    ends_at_once = True
    objective: ImageObjective   # the picture as it is seen with the camera that suits the code so far

    def __init__(self, problem: SearchProblem, number: int = 0, restart: float = 0):
        super().__init__(problem, number, restart)
        self._tries = _tries(problem)

    @staticmethod
    def may_help(problem: SearchProblem) -> bool:
        """Whether an image may show a whole construction: lines and areas that others drew, not too many pixels."""
        params = problem.params
        return (problem.levels.known is None and params.camera.estimate and bool(_tries(problem))
                and not problem.is_reduced and not params.maps)

    @property
    def expected_moves(self) -> int:
        return len(self._tries)

    def is_wanted(self, state: State) -> bool:
        if state.current is not None:
            return True
        if state.measured_through is not None or state.best is None:  # a density; or no time was left for a search
            return False
        if len(state.leader.maps) > MOST_MAPS:  # so many draw anything
            return True
        objective = self._objective_for(state.leader)
        likeness = self.likeness(state.leader, objective)
        if objective.levels.is_density:  # a scatter plot, as it seems: constructions are drawn with lines
            return likeness < UNLIKE
        most = max(tried.maps for tried in self._tries)  # a simpler code may draw the picture, too
        return likeness < BELOW or len(state.leader.maps) > most

    def open(self, state: State) -> State:
        self.objective, best = self._objective_for(state.leader), state.leader
        return state.begun(lambda: self._candidate(self.objective, self.objective.judge(best.maps, best.weights)))

    def _objective_for(self, best: Candidate) -> ImageObjective:
        problem, seed = self.problem, derive(self.problem.seed, "recursion")
        return problem.objective(len(problem.image), best.code, seed, camera=problem.camera(best.code))

    def move(self, state: State) -> State:
        return state.moved(self._better(state.now, state.step))

    def _better(self, now: Candidate, number: int) -> Candidate:
        """`now`, or what a search finds if it is better."""
        tried = self._tries[number]
        few = self._few_maps(tried, number)
        seen = (self._as_strokes(few) if tried.camera == STROKES
                else polish_under(self.objective, few, TILES, self.deadline))
        if not seen:
            return now
        best = self._candidate(*in_turns(*seen[0], self.deadline))
        to_beat = now.error if self._is_explained(now) else math.inf if self._has_tiles else STROKED * now.error
        is_better = best.error < to_beat and self._is_explained(best)
        return best if is_better or self.is_simpler(best, now) else now

    def _as_strokes(self, few: Rendered) -> list[Fit]:
        """The copies of a code with a trunk of several strokes or of one, polished as strokes, the best first. A small
        image comes first: on the whole one, strokes that lie beside those of the picture do not overlap them. Empty if
        the code is not promising there."""
        promising = math.inf if self._has_tiles else GAIN**0.5 * self.objective.angle(few.error)
        seen = self._polished(self._coarse, self._registered(self._trees(few, TRUNK_STROKES)))
        if not seen or angle_of(seen[0]) > promising:
            return []
        best = seen[0][1]
        again = self._trees(best, int(flat_maps(best.code).sum()))
        return self._polished(self.objective, [best, *(tree for tree in again if tree is not best)])

    def _polished(self, objective: ImageObjective, trees: list[Rendered]) -> list[Fit]:
        """The trees polished as strokes on an image, the best first."""
        return sorted((each for tree in trees for each in polish_under(objective, tree, STROKES, self.deadline)),
                      key=angle_of)

    def _registered(self, trees: list[Rendered]) -> list[Rendered]:
        """The trees at the depths at which their strokes come closest to the lines of the picture."""
        registration = Registration(self.objective, self.deadline)
        fits = sorted((each for tree in trees for each in registration.fits(tree)), key=lambda each: each.misfit)
        return [self.objective.judge(each.maps.to(self.objective.image)) for each in fits[:REGISTERED_KEPT]]

    def _trees(self, found: Rendered, most: int) -> list[Rendered]:
        """The copies of a code with a trunk of at most so many strokes and, apart from that, of one."""
        trees = [with_trunk(self.objective, found, each) for each in sorted({most, min(1, most)}, reverse=True)]
        return list({len(tree.maps): tree for tree in trees if tree is not None}.values())  # equally many are the same

    @cached_property
    def _coarse(self) -> ImageObjective:
        """The picture at no more than `COARSE_SIDE` pixels per side."""
        problem, camera, side = self.problem, self.params.camera, len(self.problem.image)
        size = min(side, COARSE_SIDE)
        known = {KNOWN[name]: value * size / side for name, value in camera.all_known.items() if name in LENGTHS}
        return ImageObjective(problem.levels.shrunk(problem.image, size), problem.levels,
                              self.params.updated(camera=known), problem.seed)

    def is_settled(self, state: State) -> bool:
        """Once strokes draw the picture well, nothing more is tried. Once tiles do, all searches for tiles are made."""
        if not self._is_explained(state.now):
            return False
        if has_strokes(state.now):
            return self._likeness_of_drawing(state.now) >= BELOW
        return TILES not in {each.camera for each in self._tries[state.step:]}

    def close(self, state: State) -> State:
        if self._is_explained(state.now):
            return replace(state, best=state.current, stopped="few steps of a construction explain the picture")
        return replace(state, best=state.current) if len(state.now.maps) < len(state.leader.maps) else state

    def _few_maps(self, tried: _Try, number: int) -> Rendered:
        """What a search for few maps finds. If the code is to be seen as strokes, a map is left for the trunk."""
        most = (self.params.most_maps or tried.maps + 1) - (tried.camera == STROKES)
        few = self.params.updated(at_most=min(tried.maps, most), bytes=None, likeness=None)
        masses = blurred(self.problem.masses_of(self.round), tried.blur_px)
        seed = derive(self.problem.seed, "recursion", number)
        search = MeasureSearch(masses, Regime.whole(few), few, seed, CONTRACTION)
        found = search.start()
        for move in self.deadline.during(range(few.search.moves)):
            found = search.step(found, move)
        return self.objective.judge(found.maps)

    @property
    def _has_tiles(self) -> bool:
        """Whether codes are drawn by tiles, which show the picture itself, so that an error says nothing."""
        return not self.objective.levels.shows_attractor

    def _is_explained(self, found: Candidate) -> bool:
        """Whether a code draws the picture as strokes, or as tiles of so few maps that this is no accident."""
        if not is_construction(found):
            return False
        if has_strokes(found):
            return self._likeness_of_drawing(found) >= DRAWN_ALIKE
        return self._likeness_of_drawing(found) >= ALIKE and self.likeness(found) >= UNLIKE

    def is_simpler(self, found: Candidate, now: Candidate) -> bool:
        """Whether a code draws the picture with a pen, with so few maps that it is the better code."""
        price = Price(share=self.params.moves.worth)
        has_pen = found.camera is not None and found.camera.tile == 0
        return (has_pen and len(found.maps) < len(now.maps)
                and not self._is_explained(now) and self.likeness(found) >= ALIKE
                and price.score(found.error, len(found.maps)) < price.score(now.error, len(now.maps)))

    def _likeness_of_drawing(self, found: Candidate) -> float:
        """How like the picture a code's drawing is, whatever its attractor."""
        shown, objective = self._shown(found, self.objective)
        return objective.likeness(shown.image)

    def likeness(self, found: Candidate, objective: ImageObjective | None = None) -> float:
        """How like the picture a code is, with its own camera or the one that suits the code so far."""
        shown, objective = self._shown(found, objective or self.objective)
        return objective.likeness_of(shown)

    def _shown(self, found: Candidate, objective: ImageObjective) -> tuple[Rendered, ImageObjective]:
        if found.camera is not None and found.camera.is_known:
            objective = objective.seen_with(with_camera(objective.levels, found.camera))
        return objective.judge(found.maps, found.weights), objective

    def _candidate(self, objective: ImageObjective, shown: Rendered) -> Candidate:
        error = self.pen_error(objective, shown)
        return Candidate(shown.maps, shown.weights, error, error, objective.levels.camera)

    def pen_error(self, objective: ImageObjective, shown: Rendered) -> float:
        """The error by which pens, tiles, strokes and dots are compared: that of a pen for the same angle."""
        return 2 * self.problem.levels.supersample**2 * objective.angle(shown.error) ** 2


def _tries(problem: SearchProblem) -> list[_Try]:
    """The searches: the first one for strokes, then those for tiles, then the others for strokes. None for tiles where
    the user knows the pen, none at all where the user knows that the picture shows dots."""
    params, camera = problem.params, problem.params.camera
    if TILES not in problem.levels.kinds or not camera.constructions:
        return []
    has_tiles = camera.tiles and camera.pen_px is None
    tiles = [_Try(TILED_MAPS, blur, TILES) for blur in (BLURS_PX if has_tiles else ())]
    has_strokes = camera.strokes and (params.most_maps or LEAST_TREE) >= LEAST_TREE
    strokes = [_Try(most, 0.0, STROKES) for most in (BRANCHES if has_strokes else ())]
    return [*strokes[:1], *tiles, *strokes[1:]]


def has_strokes(found: Candidate) -> bool:
    """Whether a code was last judged by what it draws as strokes."""
    return found.camera is not None and found.camera.depth is not None


def is_construction(found: Candidate) -> bool:
    """Whether a code was last judged by strokes, or by tiles of at most `TILED_MAPS` maps."""
    has_tiles = found.camera is not None and bool(found.camera.tile)
    return has_strokes(found) or has_tiles and len(found.maps) <= TILED_MAPS
