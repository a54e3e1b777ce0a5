"""Gauss-Newton on the picture itself: maps moved by small parts of a pixel.

The collage equation is solved on grids, with pixels for points, which blurs; here the residual is that of real
drawings, so a true code stays where it is. Only the Jacobian is approximate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from .. import ops
from ..ops.reference_collage import contract
from ..seeds import derive
from .measure import point_bins
from .picture import Drawn, Picture, stabilizing_slope

POINTS_PER_CELL = 6
STEP_PX = 0.05             # of the finite differences
LONGEST_PX = 2.0           # step of a parameter
LARGEST = 0.9995           # singular value
LITTLE = 0.005             # relative gain of a step that was in vain


def never() -> bool:
    """Time is not limited."""
    return False


def polished(picture: Picture, drawn: Drawn, steps: int, moving: Sequence[int] | None = None, *, patience: int = 1,
             late: Callable[[], bool] = never) -> Drawn:
    """The code after at most so many steps of Levenberg and Marquardt, never worse. moving: the maps that may move;
    patience: after how many steps in vain to stop; late: whether to stop."""
    damping, idle = 1e-2, 0
    for number in range(steps):
        if late() or idle == patience:
            break
        jacobian = _Jacobian(picture, drawn, moving if moving is not None else range(len(drawn.maps)), number)
        before = drawn.error
        for _ in range(2):
            better = _stride(picture, drawn, jacobian, jacobian.solve(damping))
            if better:
                drawn, damping = better, max(damping / 5, 1e-4)
                break
            damping *= 30
        idle = idle + 1 if before - drawn.error < LITTLE * before else 0
    return drawn


def _stride(picture: Picture, drawn: Drawn, jacobian: _Jacobian, step: Tensor) -> Drawn | None:
    """The step, or two, four or eight of it, whichever comes closest; None if it leads up."""
    best = None
    for factor in (1, 2, 4, 8):
        tried = picture.judge(jacobian.moved(factor * step), drawn.weights)
        if tried.error >= (best or drawn).error:
            break
        best = tried
    return best


class _Jacobian:
    """How the stabilised drawing changes with the parameters of some maps, each in units of a pixel's displacement.

    The measure of one run of the chaos game is followed with common random numbers (the chances are held), and the
    grey level as I = 1 - exp(-kappa m) of a cell's mass m, kappa such that it fits the drawing around the cell.
    """

    def __init__(self, picture: Picture, drawn: Drawn, moving: Sequence[int], number: int):
        self.maps, self.side = drawn.maps, picture.side
        seed, chances = derive(picture.seed, "jacobian", number), drawn.chances
        points = self._play(drawn.maps, chances, seed)
        self.mean, spread = points.mean(0), points.std(0).clamp_min(1e-3)
        pixel = 2 / picture.side
        self.units = [(i, j, pixel if j > 3 else pixel / float(spread[j % 2])) for i in moving for j in range(6)]
        known = self._bins(points)
        grey = picture.grids(drawn.image)[0]
        smooth = _smooth(grey).clamp(max=1 - 0.5 / picture.subpixels)
        kappa = torch.where(known > 0, -(1 - smooth).log() / _smooth(known).clamp_min(1e-12), 0)
        slope = picture.levels.dark(grey, smooth) * kappa
        columns = []
        for k in range(len(self.units)):
            step = torch.zeros(len(self.units))
            step[k] = STEP_PX
            changed = self._bins(self._play(self.moved(step), chances, seed))
            columns.append((changed - known) / STEP_PX * slope)
        self._normal_equations(picture, drawn, torch.stack(columns))

    def _normal_equations(self, picture: Picture, drawn: Drawn, columns: Tensor) -> None:
        count = len(columns)
        self.square, self.gradient = torch.zeros(count, count).double(), torch.zeros(count).double()
        for k, (residual, grey) in enumerate(zip(picture.residuals(drawn.image), picture.grids(drawn.image),
                                                 strict=True)):
            if k:
                columns = avg_pool2d(columns, 2, ceil_mode=True)
            scaled = (columns * stabilizing_slope(grey, picture.subpixels * 4**k)).flatten(1).double().cpu()
            self.square += scaled @ scaled.T
            self.gradient += scaled @ residual.flatten().double().cpu()

    def solve(self, damping: float) -> Tensor:
        """The step (6 maps,), pixels."""
        ridge = damping * self.square.diagonal() + 1e-9 * self.square.diagonal().max() + 1e-12
        return torch.linalg.solve(self.square + ridge.diag(), self.gradient).clamp(-LONGEST_PX, LONGEST_PX)

    def moved(self, step: Tensor) -> Tensor:
        """The maps (N,6) after a step; a matrix turns about the attractor's mean."""
        maps = self.maps.double().clone()
        for value, (i, j, unit) in zip(step.tolist(), self.units, strict=True):
            maps[i, j] += value * unit
            if j < 4:
                maps[i, 4 + j // 2] -= value * unit * float(self.mean[j % 2])
        return contract(maps.to(self.maps), LARGEST)

    def _play(self, maps: Tensor, chances: Tensor, seed: int) -> Tensor:
        return ops.chaos_game(maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:], length=430, warmup=30, seed=seed,
                              trajectories=POINTS_PER_CELL * self.side**2 // 400 + 1, probabilities=chances)

    def _bins(self, points: Tensor) -> Tensor:
        return point_bins(points, self.side)


def _smooth(image: Tensor) -> Tensor:
    return avg_pool2d(image[None], 3, 1, 1)[0]
