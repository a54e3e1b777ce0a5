"""Gauss-Newton on the picture itself: maps moved by small parts of a pixel.

The collage equation is solved on grids, with pixels for points, which blurs; here the residual is that of real
drawings, so a true code stays where it is. Only the Jacobian is approximate (`jacobian`).
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from .frame import Frame
from .jacobian import Jacobian, Played
from .picture import Drawn, Picture

LITTLE = 0.005             # relative gain of a step that was in vain
FRAMED = 1.05              # times the error before, that fitting the frame may cost


def never() -> bool:
    """Time is not limited."""
    return False


def polished(picture: Picture, drawn: Drawn, steps: int, moving: Sequence[int] | None = None, *, patience: int = 1,
             late: Callable[[], bool] = never, slopes: type[Jacobian] = Played, alone: bool = False,
             held: Collection[tuple[int, int]] = ()) -> Drawn:
    """The code after at most so many steps of Levenberg and Marquardt, never worse. moving: the maps that may move, in
    turn if they are more than `picture.maps_at_once`; patience: after how many steps in vain to stop; late: whether to
    stop; slopes: where the Jacobian is got from; alone: whether each parameter is tried alone where they lead nowhere
    together, as is done for a single map; held: entries (map, column) that stay, a translation's only with those of its
    row, since matrices turn about the attractor's mean."""
    damping, idle = 1e-2, 0
    moving = [i for i in (moving if moving is not None else range(len(drawn.maps)))
              if not {(i, j) for j in range(6)} <= set(held)]
    turns = [moving[i:i + picture.maps_at_once] for i in range(0, len(moving), picture.maps_at_once)]
    for number in range(steps * len(turns)):
        if late() or idle == patience * len(turns):
            break
        jacobian = slopes(picture, drawn, turns[number % len(turns)], number, held)
        before = drawn.error
        for _ in range(2):
            better = _stride(picture, drawn, jacobian, jacobian.solve(damping))
            if better:
                drawn, damping = better, max(damping / 5, 1e-4)
                break
            damping *= 30
        else:
            if alone or len(moving) == 1:
                drawn = _one_by_one(picture, drawn, jacobian, late)
        idle = idle + 1 if before - drawn.error < LITTLE * before else 0
    return drawn


def fitted_into_frame(picture: Picture, start: Drawn, steps: int, frame: Frame | None, *,
                      late: Callable[[], bool] = never, held: Collection[tuple[int, int]] = ()) -> Drawn:
    """The drawing polished such that the attractor fills the frame of its picture, which tells of tips too faint to be
    seen, unless there is none, or the picture is drawn notably worse for it."""
    if frame is not None:
        within = picture.within(frame)
        found = polished(within, within.judge(start.maps, start.weights), steps, patience=2, late=late, held=held)
        seen = picture.error(found.image)
        if seen <= FRAMED * start.error:
            return replace(found, error=seen)
    return polished(picture, start, steps, patience=2, late=late, held=held)


def _stride(picture: Picture, drawn: Drawn, jacobian: Jacobian, step: Tensor) -> Drawn | None:
    """The step, or two, four or eight of it, whichever comes closest; None if it leads up."""
    best = None
    for factor in (1, 2, 4, 8):
        tried = picture.judge(jacobian.moved(factor * step), drawn.weights)
        if tried.error >= (best or drawn).error:
            break
        best = tried
    return best


def _one_by_one(picture: Picture, drawn: Drawn, jacobian: Jacobian, late: Callable[[], bool]) -> Drawn:
    """The drawing after the best step in each parameter of a map in turn. Where an image is a line between two columns
    of pixels, the least of a step across it costs more than any step along it can gain."""
    steps = jacobian.solve_alone()
    taken = torch.zeros_like(steps)
    for k, step in enumerate(steps):
        if late():
            break
        for factor in (1, 2, 4, 8):
            further = taken.clone()
            further[k] = factor * step
            tried = picture.judge(jacobian.moved(further), drawn.weights)
            if tried.error >= drawn.error:
                break
            drawn, taken = tried, further
    return drawn
