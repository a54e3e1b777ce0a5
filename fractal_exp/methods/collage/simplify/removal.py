"""Codes without maps that a picture that others drew does not justify: those that nobody sees, those that its camera
makes up for, and doubles, which make lines thicker: that is the pen's job."""

from __future__ import annotations

from collections.abc import Iterable

import torch

from ....cameras.points import attractor_points
from ....ifs import affine
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.camera import may_be_sharpened
from ..params import CollageParams
from ..state import WeightedMaps
from .loop import Draft, Price, Proposer, Way, camera_polished, maps_polished, simplified, without_one

TRIED = 2   # single maps that are left out on trial where each trial is a polish with the camera, which takes seconds
NEAR_PX = 2.0     # distance (rms, pixels) below which two maps count as one: a pen is rarely thinner
POINTS = 20_000   # of the attractor, that measure this distance


def one_unseen(draft: Draft) -> Iterable[Draft]:
    """`without_one`, unless this way is switched off."""
    return () if draft.objective.params.simplify.unseen is None else without_one(draft)


def without_least(draft: Draft) -> Iterable[Draft]:
    """The code without one of those maps that are missed least."""
    is_off = draft.objective.params.simplify.needless is None
    return () if is_off else sorted(without_one(draft), key=lambda each: each.shown.error)[:TRIED]


def dropping_unseen(params: CollageParams) -> Proposer:
    """Leave out maps that nobody sees. Such maps compensate for an imperfect camera, for instance for the widths of a
    tree's branches."""
    return Proposer(one_unseen, maps_polished(params.rounding.polish), loss=params.simplify.unseen, early=True)


def without_needless(draft: Draft, *ways: Way, deadline: Deadline = NO_DEADLINE) -> Draft:
    """Leave out maps whose absence the camera can make up for.

    A code of too many maps and its camera are made for each other. With this camera, the code without such a map looks
    worse than it is. So both codes are polished together with the camera before they are compared. If no map is left
    out, `draft` itself is returned, and it takes no time if there is none to try.
    """
    params = draft.objective.params
    if not may_be_sharpened(draft.objective, draft.shown) or not any(True for way in ways for _ in way(draft)):
        return draft
    polish = camera_polished(params.rounding.polish)
    start = next(polish(draft, deadline))
    proposers = [Proposer(way, polish, loss=params.simplify.needless) for way in ways]
    found = simplified(start, proposers, Price.of_drawn(start.objective), deadline)
    return draft if found is start else found


def without_doubles(found: WeightedMaps, params: CollageParams, side: int, seed: int) -> WeightedMaps:
    """The code without its doubles in an image of `side` pixels, if at least two maps stay and no number of maps is
    asked for. A map is a double if it sends the attractor to nearly where a heavier map sends it, which gets its
    weight. No error is compared: until a camera is known, the error of a thicker line says nothing."""
    if params.maps:
        return found
    points = attractor_points(found.maps, found.probabilities, POINTS, seed)
    images, weights = affine.images(found.maps, points), found.probabilities
    apart = (images[:, None] - images[None]).square().sum(-1).mean(-1).sqrt()
    kept: list[int] = []
    for i in weights.argsort(descending=True, stable=True).tolist():
        same = [k for k in kept if float(apart[i, k]) < 2 / side * NEAR_PX]
        if same:
            weights = weights.index_add(0, torch.tensor(same[:1], device=weights.device), weights[i:i + 1])
        else:
            kept.append(i)
    kept.sort()
    alone = len(kept) < 2 or len(kept) == len(found.maps)
    return found if alone else WeightedMaps(found.maps[kept], weights[kept])
