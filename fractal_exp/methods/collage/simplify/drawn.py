"""The simplest code of a picture that others drew, in every way that the picture and the camera allow."""

from __future__ import annotations

from collections.abc import Iterator

from ....cameras.strokes import as_lines
from ....likeness import UNLIKE
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.camera import in_turns, sharpened
from ..image.gauss_newton import polished
from .flat import flattened, on_line
from .loop import DRAWN_WORSE, Draft, Price, Proposer, Pruning, maps_polished, simplified
from .parents import fewer, uncontained
from .removal import dropping_unseen, without_least, without_needless
from .rounding import begun, rounded
from .symmetry import least_turned_code, other_least_turned_code


def simplified_in_every_way(start: Draft, deadline: Deadline = NO_DEADLINE) -> Draft:
    """A simpler code with the camera that suits it. It is as like the picture as `start`, or like it to
    `UNLIKE`: tiles may draw the picture of a code whose attractor is another shape."""
    params = start.objective.params
    worth, line = Price(share=params.moves.worth), Price(worse=DRAWN_WORSE)   # a line is told from a curve by little
    now = simplified(_with_simplest_maps(start, worth, deadline), [Proposer(on_line, _flat, repeats=False)], line,
                     deadline)
    needed = without_needless(now, uncontained, without_least, deadline=deadline)
    if needed is not now:
        needed = Draft(*in_turns(needed.objective, needed.shown, deadline))
    now = rounded(begun(needed.objective, needed.shown), deadline)
    now = simplified(now, [Proposer(Pruning(worth))], worth, deadline)
    now = simplified(now, [Proposer(without_width, repeats=False)], Price.of_drawn(now.objective), deadline)
    least = min(UNLIKE, start.objective.likeness_of(start.shown))
    return now if now.objective.likeness_of(now.shown) >= least else start


def _with_simplest_maps(start: Draft, worth: Price, deadline: Deadline) -> Draft:
    """The code without maps that need not be, with the camera that suits it. Codes may differ by symmetries of the
    shape, by doubles, and by parents in the place of maps."""
    params, drawn = start.objective.params, Price.of_drawn(start.objective)
    polish = maps_polished(params.rounding.polish)
    now = simplified(start, [dropping_unseen(params)], drawn, deadline)
    now = without_needless(now, uncontained, deadline=deadline)
    now = simplified(now, [Proposer(least_turned_code, polish, repeats=False)], drawn, deadline)
    now = simplified(now, [Proposer(fewer, polish)], worth, deadline)
    other = simplified(now, [Proposer(other_least_turned_code, _with_its_camera, repeats=False)], Price(), deadline)
    return Draft(*sharpened(now.objective, now.shown, deadline)) if other is now else other


def _with_its_camera(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
    """A code that draws the picture, with the camera that suits it."""
    objective = draft.objective
    shown = polished(objective, draft.shown, objective.params.rounding.polish, deadline=deadline)
    if objective.likeness(shown.image) >= UNLIKE:
        yield Draft(*sharpened(objective, shown, deadline))


def _flat(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
    """Similarities on a line with the camera that suits them. What maps do across the line may draw a pen's width:
    points of a near isometry take long to reach the line. The polish brings some of it back, so the maps are replaced
    again after it."""
    objective, found = sharpened(draft.objective, draft.shown, deadline)
    yield Draft(objective, objective.judge(flattened(objective, found), found.weights))


def without_width(draft: Draft) -> Iterator[Draft]:
    """Strokes that have no width. A drawing by strokes does not tell their widths."""
    objective, found = draft.objective, draft.shown
    if not objective.levels.is_whole:
        yield draft.judged(as_lines(found.code).to(found.maps), found.weights)
