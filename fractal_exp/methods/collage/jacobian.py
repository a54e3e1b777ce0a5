"""How the drawing of a code changes with its maps: the normal equations of `polish`."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ... import ops
from ...ops.collage import orbit_bins
from ...ops.collage.reference import contract
from ...runtime.seeds import derive
from . import maps as affine
from .measure import point_bins
from .picture import Drawn, Picture, stabilizing_slope

POINTS_PER_CELL = 6
ROWS = 2**21               # numbers of a Jacobian that are multiplied at once
STEP_PX = 0.05             # of the finite differences
LONGEST_PX = 2.0           # step of a parameter
LARGEST = 0.9995           # singular value


class Jacobian(ABC):
    """How the stabilised drawing changes with the parameters of some maps, each in units of a pixel's displacement, as
    normal equations over all grids, and over the frame if the picture has one. held: entries (map, column) that
    stay."""

    def __init__(self, picture: Picture, drawn: Drawn, moving: Sequence[int], number: int,
                 held: Collection[tuple[int, int]] = ()):
        self.maps, self.side = drawn.maps, picture.side
        self.seed = derive(picture.seed, "jacobian", number)
        self.points = self._play(drawn.maps, drawn.chances)
        self.mean, spread = self.points.mean(0).tolist(), self.points.std(0).clamp_min(1e-3).tolist()
        pixel = 2 / picture.side
        self.units = [(i, j, pixel if j > 3 else pixel / spread[j % 2]) for i in moving for j in range(6)
                      if (i, j) not in held]
        count = len(self.units)
        self.square, self.gradient = torch.zeros(count, count).double(), torch.zeros(count).double()
        for residual, (columns, slope) in zip(picture.residuals(drawn.image), self.grids(picture, drawn), strict=True):
            rows = max(1, ROWS // (count * len(residual)))
            for part in range(0, len(residual), rows):  # in pieces, for the sake of memory
                piece = slice(part, part + rows)
                scaled = (columns[:, piece] * slope[piece]).flatten(1).double()
                self.square += (scaled @ scaled.T).cpu()
                self.gradient += (scaled @ residual[piece].flatten().double()).cpu()
        if picture.frame is not None:
            self._add_frame(picture, drawn)

    @abstractmethod
    def grids(self, picture: Picture, drawn: Drawn) -> Iterator[tuple[Tensor, Tensor]]:
        """For each grid the derivatives (parameters,h,w), and what (h,w) they are yet to be multiplied by."""

    def _add_frame(self, picture: Picture, drawn: Drawn) -> None:
        misfit = picture.frame.misfit(drawn.maps, drawn.chances)
        _, weights = picture.frame.penalty(misfit)
        slopes = picture.frame.slopes(drawn.maps, drawn.chances) * weights[:, None, None]
        columns = torch.stack([
            unit * (slopes[:, i, j] - (self.mean[j % 2] * slopes[:, i, 4 + j // 2] if j < 4 else 0))
            for i, j, unit in self.units])
        counted = 2 * picture.subpixels  # residuals of the picture have the variance 1 / 2n, those of the frame 1
        self.square += columns @ columns.T / counted
        self.gradient -= columns @ (misfit * weights) / counted

    def solve(self, damping: float) -> Tensor:
        """The step (6 maps,), pixels."""
        ridge = damping * self.square.diagonal() + 1e-9 * self.square.diagonal().max() + 1e-12
        return torch.linalg.solve(self.square + ridge.diag(), self.gradient).clamp(-LONGEST_PX, LONGEST_PX)

    def solve_alone(self) -> Tensor:
        """The steps (6 maps,), pixels, of each parameter if no other moved."""
        return (self.gradient / self.square.diagonal().clamp_min(1e-12)).clamp(-LONGEST_PX, LONGEST_PX)

    def moved(self, step: Tensor) -> Tensor:
        """The maps (N,6) after a step; a matrix turns about the attractor's mean."""
        maps = self.maps.tolist()  # number by number, for which tensors are slow, and a GPU's still more
        for value, (i, j, unit) in zip(step.tolist(), self.units, strict=True):
            maps[i][j] += value * unit
            if j < 4:
                maps[i][4 + j // 2] -= value * unit * self.mean[j % 2]
        return contract(self.maps.new_tensor(maps), LARGEST)

    def nudged(self, parameter: int, step: float) -> Tensor:
        """The maps (N,6) with one parameter moved."""
        alone = torch.zeros(len(self.units))
        alone[parameter] = step
        return self.moved(alone)

    def _play(self, maps: Tensor, chances: Tensor) -> Tensor:
        return played(maps, chances, POINTS_PER_CELL * self.side**2, self.seed)

    def _binned(self, maps: Tensor, chances: Tensor) -> Tensor:
        """The measures (B,G,G) of what is played with maps (B,N,6)."""
        return orbit_bins(maps, chances, self.side, seed=self.seed, **orbits(POINTS_PER_CELL * self.side**2))


class Played(Jacobian):
    """From one run of the chaos game, followed with common random numbers (the chances are held), and the grey level as
    I = 1 - exp(-kappa m) of a cell's mass m, kappa such that it fits the drawing around the cell."""

    def grids(self, picture: Picture, drawn: Drawn) -> Iterator[tuple[Tensor, Tensor]]:
        known = point_bins(self.points, self.side)
        greys = picture.grids(drawn.image)
        smooth = _smooth(greys[0]).clamp(max=1 - 0.5 / picture.subpixels)
        kappa = -(1 - smooth).log() / _smooth(known).clamp_min(1e-12)
        kappa = torch.where(known > 0, kappa, 0)
        slope = picture.levels.dark(greys[0], smooth) * kappa
        columns = self._binned(torch.stack([self.nudged(k, STEP_PX) for k in range(len(self.units))]), drawn.chances)
        columns.sub_(known).div_(STEP_PX).mul_(slope)
        for k, grey in enumerate(greys):
            if k:
                columns = avg_pool2d(columns, 2, ceil_mode=True)
            yield columns, stabilizing_slope(grey, picture.subpixels * 4**k)


class Redrawn(Jacobian):
    """From drawings of the code with each parameter moved to and fro: several times slower, and right where an image
    ends at the edge of a pixel, which bins know nothing of."""

    def grids(self, picture: Picture, drawn: Drawn) -> Iterator[tuple[Tensor, Tensor]]:
        nudge = picture.levels.nudge_px
        columns = [grid.new_empty(len(self.units), *grid.shape) for grid in picture.stable]
        for k in range(len(self.units)):
            fro, to = (picture.stabilized(picture.draw(affine.to_code(self.nudged(k, step), drawn.weights)))
                       for step in (-nudge, nudge))
            for column, before, after in zip(columns, fro, to, strict=True):
                column[k] = (after - before) / (2 * nudge)
        for column in columns:
            yield column, torch.ones_like(column[0])


def played(maps: Tensor, chances: Tensor, count: int, seed: int) -> Tensor:
    """About so many points (P,2) of the chaos game with maps (N,6) and chances (N,)."""
    return ops.chaos_game(maps[:, :4].unflatten(1, (2, 2)), maps[:, 4:], seed=seed, probabilities=chances,
                          **orbits(count))


def orbits(count: int) -> dict[str, int]:
    """The numbers of the chaos game for about so many points."""
    return {"trajectories": count // 400 + 1, "length": 430, "warmup": 30}


def _smooth(image: Tensor) -> Tensor:
    return avg_pool2d(image[None], 3, 1, 1)[0]
