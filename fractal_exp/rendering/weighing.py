"""How many points a view needs: the share of the invariant measure that lies in it, weighed by dry runs."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass, replace

import numpy as np
from torch import Tensor

from ..errors import InputError
from ..ifs import attractor
from ..ifs.code import IFS, View
from ..ops.histogram import AddressTree, Window
from ..runtime.checks import size_of

log = logging.getLogger(__name__)

PILOT_POINTS = 65_536        # points that weigh a view, to 0.4%
WORD = 4                     # work of visiting a word, in points thrown
SEARCH_WORK = 30_000_000     # points thrown before a view counts as empty: about a tenth of a second
WORK, WORK_PER_POINT = 1_000_000_000, 25  # limits for a view: about ten seconds at 50 million points
HULL_DIRECTIONS = 128        # of the half planes whose smallest rectangle is taken: a rectangle need not be tight
HULL_TOLERANCE = 1e-3        # of their bounds, relative to the radius of the attractor's disc
EVERYWHERE = 1e9             # times the likely rectangle of a measure with tails: with it, no word is left out


@dataclass(frozen=True)
class Plan:
    """How many points to throw at the whole attractor so that the view gets the requested number."""

    tree: AddressTree
    thrown: float
    mass: float
    reason: str | None = None


def address_tree(code: IFS, reuse: int = 1, *, with_colours: bool = False) -> AddressTree:
    """The code with the smallest rectangle about its half planes. Raises `InputError` if colours are wanted and there
    are none."""
    probabilities = code.sampling_probabilities()
    colours = _colours(code, probabilities) if with_colours else None
    h = attractor.support_function(code, HULL_DIRECTIONS, HULL_TOLERANCE)
    quarter = len(h) // 4
    # Widths and middles along direction k and across it.
    along, across = h[:quarter] + h[2 * quarter:3 * quarter], h[quarter:2 * quarter] + h[3 * quarter:]
    k = int((along * across).argmin())
    angle = 2 * math.pi * k / len(h)
    axes = np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])
    center = axes @ np.array([h[k] - h[k + 2 * quarter], h[k + quarter] - h[k + 3 * quarter]]) / 2
    slack = 1 + 1e-9  # covers the rounding of all this
    hull = axes * np.array([along[k], across[k]]) / 2 * slack
    return AddressTree.of(code.linear, code.offset, probabilities, center, hull, reuse, colours)


def _colours(code: IFS, probabilities: Tensor) -> tuple[Tensor, Tensor]:
    if code.colours is None:
        raise InputError('the code has no colours to draw; invert(..., colour=True) finds them in a picture, '
                         'IFS(..., colours=Colours(rgb, blends)) gives them, and mode="occupancy" draws without')
    code.colours.shares(probabilities)  # or it raises
    return code.colours.rgb, code.colours.blends


def window_of(view: View, resolution: int | tuple[int, int]) -> Window:
    """A view on pixels: (height, width), or one number for both."""
    (x, y), (height, width) = view.center, size_of(resolution)
    shorter = min(height, width)
    return Window(x - width / shorter / view.zoom, y + height / shorter / view.zoom, shorter * view.zoom / 2, width,
                  height)


def weighed(tree: AddressTree, window: Window, points: int, seed: int, effort: float, near: float, *, has_tails: bool
            ) -> Plan:
    """How many points to throw for so many in the window. has_tails: whether the measure may have points beyond the
    tree's rectangle, which are looked for if nothing else is in the window. effort, near: as for
    `still.render_with_info`."""
    plan = _weigh(tree, window, points, seed, effort, near)
    if plan.mass > 0 or not has_tails:
        return plan
    plan = _weigh(replace(tree, hull=tree.hull * EVERYWHERE), window, points, seed, effort, 0.0)
    if plan.mass > 0:
        log.warning("the view holds nothing but tails, %.1g of the measure: %.2g points are thrown for its %.2g",
                    plan.mass, plan.thrown, plan.thrown * plan.mass)
    return plan


def _weigh(tree: AddressTree, window: Window, points: int, seed: int, effort: float, near: float) -> Plan:
    """Estimate how much of the invariant measure lies in the window, by dry runs with more and more points."""
    if tree.within(window):
        return Plan(tree, float(points), 1.0)
    # With infinitely many points, the tree is searched, not sampled, and the budget ends the search at the first leaf.
    if tree.scatter(window, 1e280, seed=(seed, 1), tasks=1, budget=SEARCH_WORK / 32).finished:
        return Plan(tree, 0.0, 0.0, "the view holds no point of the attractor: the image is empty")
    allowed = effort * (WORK + WORK_PER_POINT * points)
    pilot = effort * PILOT_POINTS
    thrown, attempt = (1.5 * pilot / near if near > 0 else 4096.0), 0
    while True:
        attempt += 1
        tally = tree.scatter(window, thrown, seed=(seed, 1, attempt), budget=allowed / 8 if near > 0 else math.inf)
        if near > 0 and not tally.finished:  # this view is not like that one
            return _weigh(tree, window, points, seed, effort, 0.0)
        work = tally.thrown + WORD * tally.visited + 1
        # Words are shared, so work grows less than proportionally to the points: what follows is a bound.
        work_per_point = work / max(tally.kept, 1)
        if tally.kept >= pilot and work_per_point * points <= allowed:
            break
        wanted = 1.5 * pilot / tally.kept if 0 < tally.kept < pilot else 1000.0
        growth = min(1000.0, wanted, (allowed / 8 if tally.kept else SEARCH_WORK) / work)
        if growth < 1.5 or thrown > 1e250:
            break
        thrown *= growth
    if tally.kept == 0:
        return Plan(tree, 0.0, 0.0, f"no point of the attractor was found in the view, trying {tally.visited} words "
                                     f"of its address tree and {tally.thrown} points: the image is empty")
    mass, fewer = min(1.0, tally.kept / thrown), int(allowed / work_per_point)
    if fewer >= points:
        return Plan(tree, points / mass, mass)
    return Plan(tree, fewer / mass, mass, f"the code's maps overlap so much, or its tails are so long, that a point "
                                           f"of this view takes up to {work_per_point:.0f} throws: drew about {fewer} "
                                           f"of {points} points")
