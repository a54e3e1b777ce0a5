"""Gauss-Newton on the rendering itself: it moves maps by small parts of a pixel.

The collage equation is solved on grids, with pixels as points, which blurs. Here the residual comes from real
renderings, so a true code stays where it is. Only the Jacobian is approximate.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ....runtime.deadline import NO_DEADLINE, Deadline
from .jacobian import FromPoints, Jacobian
from .objective import FIRM_ABOVE, Frame, ImageObjective, Rendered

DAMPING = 1e-2           # of the first step, relative to the diagonal of the normal equations
LEAST_DAMPING = 1e-4     # below it, steps become noise
DAMPING_DOWN = 5.0       # factor by which damping is divided after a step that lowers the error
DAMPING_UP = 30.0        # factor by which it is multiplied after a step that does not
TRIES = 2                # dampings tried in a step
LITTLE = 0.005           # relative gain below which a step counts as without gain
PATIENCE = 1             # steps without gain, in a row, after which a polish ends; see `GaussNewtonParams` for the last
FRAME_WORSE = 1.05       # factor on the error up to which a code fitted into the frame is kept
FIRM_WORSE = 2.0         # the same for firm polishes, of binary images that hardly show tips
FIRM_STEPS = 6           # of each firm polish


def polished(objective: ImageObjective, rendered: Rendered, steps: int, moving: Sequence[int] | None = None, *,
             patience: int = PATIENCE, deadline: Deadline = NO_DEADLINE, jacobian: type[Jacobian] | None = None,
             alone: bool = False, fixed: Collection[tuple[int, int]] = (), camera: bool = False) -> Rendered:
    """The code after at most `steps` Levenberg-Marquardt steps. It is never worse than before.

    moving: the maps that may move, None: all; patience: steps without gain, in a row, before the end; jacobian: its
    class, None: `FromPoints`, or `FromCounts` for linear grey levels; alone: whether each parameter is tried by itself
    if all together lead nowhere, as is always done for a single line; fixed: entries (map, column) that stay; camera:
    whether the open values of the camera move as well, so that the result may have other levels. A fixed offset needs a
    fixed matrix row, because matrices act about the attractor's mean.
    """
    params = objective.params.gauss_newton
    moving = [i for i in (moving if moving is not None else range(len(rendered.maps)))
              if not {(i, j) for j in range(6)} <= set(fixed)]
    if not moving or not params.enabled:
        return rendered
    if jacobian is None and objective.levels.is_linear:
        from .counts import FromCounts  # for such images alone

        jacobian = FromCounts
    jacobian = jacobian or FromPoints
    damping, idle = DAMPING, 0
    for number in range(steps):
        if deadline.passed or idle == patience:
            break
        objective = objective.seen_with(rendered.levels) if camera else objective
        change = jacobian(objective, rendered, moving, number, fixed, camera)
        before = rendered.error
        for _ in range(TRIES):
            better = _stride(objective, rendered, change, change.solve(damping))
            if better:
                rendered, damping = better, max(damping / DAMPING_DOWN, LEAST_DAMPING)
                break
            damping *= DAMPING_UP
        else:
            if alone or (len(moving) == 1 and change.is_line(moving[0])):
                rendered = _one_by_one(objective, rendered, change, deadline)
        idle = idle + 1 if before - rendered.error < LITTLE * before else 0
    return rendered


def fitted_into_frame(objective: ImageObjective, start: Rendered, steps: int, frame: Frame | None, *,
                      deadline: Deadline = NO_DEADLINE, fixed: Collection[tuple[int, int]] = ()) -> Rendered:
    """Polish the code so that its attractor fills the frame of its image, which constrains tips too faint to be seen.
    Polish it without the frame if there is none, or if the frame makes the rendering notably worse."""
    if frame is not None:
        found = framed(objective, start, steps, frame, deadline=deadline, fixed=fixed)
        if found.error <= FRAME_WORSE * start.error:
            return found
    return polished(objective, start, steps, patience=objective.params.gauss_newton.last_patience, deadline=deadline,
                    fixed=fixed)


def framed(objective: ImageObjective, start: Rendered, steps: int, frame: Frame | None, *,
           deadline: Deadline = NO_DEADLINE, fixed: Collection[tuple[int, int]] = ()) -> Rendered:
    """Polish the code within a frame. The error is that of its rendering alone."""
    within = objective.within(frame)
    found = polished(within, within.judge(start.maps, start.weights), steps, deadline=deadline, fixed=fixed,
                     patience=objective.params.gauss_newton.last_patience)
    return replace(found, error=objective.error(found.image))


def firmly_framed(objective: ImageObjective, found: Rendered, deadline: Deadline = NO_DEADLINE) -> Rendered:
    """The code of a binary image, polished with ever larger weights of its frame, until it is nearly right. Each
    polish begins with the code of the one before. The result is the code of least `framed_error` that has at most
    `FIRM_WORSE` times the error of the first code, and is hopeless only if the first code was."""
    hopeless, frame = objective.is_hopeless, objective.firm_frame()
    if frame is None:
        return found
    best, least, most = found, objective.framed_error(found), FIRM_WORSE * found.error
    for factor in objective.params.frame.firm:
        if deadline.passed or best.error < FIRM_ABOVE * objective.noise(best.code):
            break
        firmer = replace(frame, sigma_px=frame.sigma_px / factor**0.5)
        found = framed(objective, found, FIRM_STEPS, firmer, deadline=deadline)
        error = objective.framed_error(found)
        if error < least and found.error <= most and (hopeless(best.error) or not hopeless(found.error)):
            best, least = found, error
    return best


def _stride(objective: ImageObjective, rendered: Rendered, jacobian: Jacobian, step: Tensor) -> Rendered | None:
    """The code after the step or its best multiple; None if the step raises the error."""
    best = None
    for factor in objective.params.gauss_newton.strides:
        seen = jacobian.seen(objective, factor * step)
        tried = seen.judge(jacobian.moved(factor * step), jacobian.weighed(factor * step))
        if tried.error >= (best or rendered).error:
            break
        best = tried
    return best


def _one_by_one(objective: ImageObjective, rendered: Rendered, jacobian: Jacobian, deadline: Deadline) -> Rendered:
    """The code after the best step in each parameter of a map in turn. If an image is a line between two columns of
    pixels, even the smallest step across it costs more than any step along it can gain."""
    steps = jacobian.solve_alone()
    taken = torch.zeros_like(steps)
    for k, step in deadline.during(enumerate(steps)):
        for factor in objective.params.gauss_newton.strides:
            further = taken.clone()
            further[k] = factor * step
            tried = objective.judge(jacobian.moved(further), jacobian.weighed(further))
            if tried.error >= rendered.error:
                break
            rendered, taken = tried, further
    return rendered
