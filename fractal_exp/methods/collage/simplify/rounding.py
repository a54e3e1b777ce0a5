"""Round entries near simple numbers, if the image allows it.

An image determines a matrix to about 0.01 px, but barely constrains how a line was projected. If simple numbers are
that near and render the image as well, they are likelier than the found ones (the shorter description; Rissanen 1978).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.gauss_newton import fitted_into_frame, framed, polished
from ..image.jacobian import FromPoints, FromRenderings
from ..image.objective import Frame, ImageObjective, Rendered, error_of
from .loop import Draft, Price, Proposer, simplified
from .simple_maps import OFF_MIDDLE, Line, Precision, Spread, mirrored_offsets

Fixed = frozenset[tuple[int, int]]   # entries (map, column) of a code

LINE_WORSE = 1.0      # factor on the error for lines along an axis: their polish is free to lower it
FILLED_WORSE = 1.2    # factor on the error for the exact frame, which says more about tips than pixels do
LINE_STEPS = 3        # Gauss-Newton steps of a line alone
SYMMETRIC_PX = 0.1    # difference, pixels, up to which offsets are made the same
FRAMED_PX = 0.5       # misfit, pixels, up to which a frame is meant to be filled
EXACT_PX = 0.002      # `Frame.sigma_px` of a frame that is filled exactly
NUDGES = 0.0, 1e-6, -1e-6, 1e-5, -1e-5, 5e-5, -5e-5   # relative changes of size: a shape may end at edges of pixels


def begun(objective: ImageObjective, shown: Rendered) -> Draft:
    """The code to be rounded, with the frame that its polishes must fill: its own, or the firm one of a binary image if
    it nearly fills that."""
    own, firm = objective.own_frame(), objective.firm_frame()
    draft = Draft(objective, shown, frame=own)
    return replace(draft, frame=firm) if own is None and firm is not None and _is_meant(shown, firm) else draft


def rounded(start: Draft, deadline: Deadline = NO_DEADLINE) -> Draft:
    """Fill the frame exactly, round simple numbers, and make nearly symmetric offsets symmetric. Each change is undone
    if it makes the rendering worse."""
    now = symmetric(with_simple_numbers(filled(start, deadline), deadline), deadline)
    return symmetric(filled(now, deadline), deadline) if now.fixed else now


def with_simple_numbers(start: Draft, deadline: Deadline = NO_DEADLINE) -> Draft:
    """The code with simple numbers rounded, unless that makes the rendering worse."""
    def rest_polished(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
        """Polish the entries that are not fixed, and make offsets symmetric."""
        shown = fitted_into_frame(draft.objective, draft.shown, draft.objective.params.rounding.polish, draft.frame,
                                  deadline=deadline, fixed=draft.fixed)
        yield symmetric(replace(draft, shown=shown), deadline)

    matrices = Proposer(simple_entries, rest_polished)
    lines = [Proposer(way, rest_polished, worse) for i in range(len(start.shown.maps))
             for way, worse in ((partial(axis_line, i, deadline), LINE_WORSE), (partial(simple_scale, i), None))]
    return simplified(start, [matrices, *lines, matrices], Price(worse=Precision.of(start.objective).worse), deadline)


def filled(start: Draft, deadline: Deadline = NO_DEADLINE) -> Draft:
    """Fill the frame exactly if it is meant to be filled, unless that makes the rendering notably worse."""
    def into_frame(draft: Draft, deadline: Deadline) -> Iterator[Draft]:
        middle = {(i, 4 + axis) for i, axis in _in_the_middle(draft.shown.maps)
                  if {(i, 2 * axis), (i, 2 * axis + 1)} <= draft.fixed}
        yield replace(draft, shown=framed(draft.objective, draft.shown, draft.objective.params.rounding.polish,
                                          draft.frame, deadline=deadline, fixed=draft.fixed | middle))

    return simplified(start, [Proposer(exact_frame, into_frame, repeats=False)], Price(worse=FILLED_WORSE), deadline)


def symmetric(start: Draft, deadline: Deadline = NO_DEADLINE) -> Draft:
    """Make nearly symmetric offsets symmetric, unless that makes the rendering worse."""
    price = Price(worse=Precision.of(start.objective).symmetric_worse)
    return simplified(start, [Proposer(symmetric_offsets, repeats=False)], price, deadline)


def exact_frame(draft: Draft) -> Iterator[Draft]:
    """The code in the exact frame, if it nearly fills its frame."""
    if draft.frame is not None and _is_meant(draft.shown, draft.frame):
        yield replace(draft, frame=replace(draft.frame, sigma_px=EXACT_PX))


def symmetric_offsets(draft: Draft) -> Iterator[Draft]:
    """Symmetric offsets in the place of nearly symmetric ones. Offsets in the middle of the canvas go to the better
    side of it. If the frame is meant to be filled, all offsets are scaled to fill it."""
    objective, now, frame = draft.objective, draft.shown, draft.frame
    maps = mirrored_offsets(now.maps, 2 / objective.side * SYMMETRIC_PX)
    if not objective.params.rounding.symmetric or bool((maps == now.maps).all()):
        return
    within = objective.within(frame)
    found = within.judge(maps, now.weights)
    for i, axis in _in_the_middle(maps):
        other = found.maps.clone()
        other[i, 4 + axis] = OFF_MIDDLE if other[i, 4 + axis] <= 0 else -OFF_MIDDLE
        found = min(found, within.judge(other, now.weights), key=error_of)
    if frame is not None and _is_meant(found, frame):
        linear, offset = found.maps[:, :4], found.maps[:, 4:] * frame.enlargement(found.maps, found.probabilities)
        sizes = [torch.cat([linear, offset * (1 + nudge)], 1) for nudge in NUDGES]
        found = min(found, *(within.judge(size, now.weights) for size in sizes), key=error_of)
    yield replace(draft, shown=replace(found, error=objective.error(found.image)))


def simple_entries(draft: Draft) -> Iterator[Draft]:
    """Simple matrices in the place of all that are near one. This may bring further ones near."""
    now, maps, fixed = draft.shown, draft.shown.maps.clone(), draft.fixed
    if not draft.objective.params.rounding.matrices:
        return
    spread = Spread.of(now, draft.objective)
    for i, one in enumerate(now.maps):
        simple = None if _matrix(i) <= fixed else spread.rounded(one)
        if simple is not None:
            maps[i], fixed = simple, fixed | _matrix(i)
    if fixed > draft.fixed:
        yield replace(draft, shown=draft.objective.judge(maps, now.weights), fixed=fixed)


def axis_line(i: int, deadline: Deadline, draft: Draft) -> Iterator[Draft]:
    """A line along an axis in the place of map i, if it nearly is one. The likeliest lines are polished alone."""
    tried = draft.objective.params.rounding.lines_tried
    if not tried or _matrix(i) & draft.fixed:
        return
    lines = Spread.of(draft.shown, draft.objective).lines(draft.shown.maps[i])
    hasty = replace(draft, objective=draft.objective.hasty())
    likely = [(polished(hasty.objective, each, LINE_STEPS, [i], deadline=deadline, jacobian=FromPoints, fixed=fixed),
               fixed) for each, fixed in _likeliest(hasty, i, lines, tried)]
    if likely:
        rough, fixed = min(likely, key=lambda found: found[0].error)
        found = polished(draft.objective, draft.objective.judge(rough.maps, rough.weights), LINE_STEPS, [i],
                         deadline=deadline, jacobian=FromRenderings, fixed=fixed)
        yield replace(draft, shown=found, fixed=fixed)


def simple_scale(i: int, draft: Draft) -> Iterator[Draft]:
    """A simple scale for map i, if it is a line along an axis."""
    known = frozenset(j for k, j in draft.fixed if k == i)
    if len(known & frozenset(range(4))) == 3:
        line = Line(draft.shown.maps[i], *(frozenset(range(4)) - known), fixed=known)
        (found, fixed), *_ = _likeliest(draft, i, Spread.of(draft.shown, draft.objective).rescaled(line), 1)
        yield replace(draft, shown=found, fixed=draft.fixed | _matrix(i))


def _likeliest(draft: Draft, i: int, lines: Iterable[Line], count: int) -> list[tuple[Rendered, Fixed]]:
    """The codes, with their fixed entries, of the `count` lines that give the nearest renderings in the place of map
    i."""
    tried = []
    for line in lines:
        maps = draft.shown.maps.clone()
        maps[i] = line.one
        tried.append((draft.objective.judge(maps, draft.shown.weights), draft.fixed | {(i, j) for j in line.fixed}))
    return sorted(tried, key=lambda found: found[0].error)[:count]


def _is_meant(found: Rendered, frame: Frame) -> bool:
    """Whether the code nearly fills the frame, so that it is meant to."""
    return bool(frame.misfit(found.maps, found.probabilities).abs().max() < FRAMED_PX)


def _in_the_middle(maps: Tensor) -> list[list[int]]:
    """The pairs [map, axis] of offsets that are zero up to about `OFF_MIDDLE`, where they were put."""
    return (maps[:, 4:].abs() < 2 * OFF_MIDDLE).nonzero().tolist()


def _matrix(i: int) -> Fixed:
    return frozenset((i, j) for j in range(4))
