"""Derivatives of a rendering by the entries of maps, for `gauss_newton`: from points or from renderings."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Sequence
from functools import cached_property

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from ....cameras.camera import LENGTHS
from ....cameras.levels import Levels
from ....cameras.points import attractor_points, trajectories
from ....ifs import affine
from ....ops.collage import orbit_bins
from ....runtime.seeds import derive
from ..limits import limited
from .objective import Frame, ImageObjective, Rendered

WEIGHT = 6                 # the column of a map's probability, after its six entries
CAMERA = 7                 # stands for a value of the camera: (index in `Levels.values`, CAMERA, step)
LONGEST_PX = 2.0           # maximum step of a parameter, pixels of displacement
LEAST_SPREAD = 1e-3        # canvas units, of the attractor's standard deviation: the unit of steps of a matrix
LOG_STEP = 0.1             # in the logarithm of a probability, a gain or a gamma: counts as much as a pixel
WIDEST_PX = 2.0            # width of a line, pixels, taken as four standard deviations
WINDOW = 3                 # cells per side of the window in which grey levels are related to masses
STEP_PX = 0.05             # finite difference of a parameter in a Jacobian from points
STROKE_EFFECT = 1e-3       # share of the largest sum of squared derivatives below which a parameter of strokes stays:
#                            the width of a stroke has no effect until the map is no longer flat
NUDGE_PX = 0.05            # finite difference of a parameter in a Jacobian from renderings
BINARY_NUDGE_PX = 0.3      # the same for a binary image, which changes by whole pixels
PIECE = 2**21              # numbers of a Jacobian that are multiplied at once, to limit the memory
MOMENTS = 50_000           # points that show the mean and the spread of an attractor: they only set units


class Jacobian(ABC):
    """Derivatives of the stabilised rendering by the parameters of some maps, each in units of a pixel's displacement.
    They are kept as normal equations over all grids, and over the frame if the objective has one. fixed: entries (map,
    column) that stay; camera: whether the open values of the camera move as well."""

    def __init__(self, objective: ImageObjective, rendered: Rendered, moving: Sequence[int], number: int,
                 fixed: Collection[tuple[int, int]] = (), camera: bool = False):
        self.params, self.largest = objective.params.gauss_newton, objective.largest
        self.maps, self.side = rendered.maps, objective.side
        self.least_effect = 0.0 if objective.levels.is_whole else STROKE_EFFECT
        self.seed = derive(objective.seed, "jacobian", number)
        self.count = int(self.params.points_per_cell * self.side**2)
        self.game = trajectories(self.count)
        points = attractor_points(rendered.maps, rendered.probabilities, MOMENTS, self.seed)
        self.mean = points.mean(0).tolist()
        self.covariance = points.double().T.cov().cpu()
        spread = points.std(0).clamp_min(LEAST_SPREAD).tolist()
        pixel = 2 / objective.side
        self.weights = rendered.weights
        self.units = [(i, j, pixel if j > 3 else pixel / spread[j % 2]) for i in moving for j in range(6)
                      if (i, j) not in fixed] + self.weight_units(moving)
        if camera:  # lengths move by pixels, logarithms of other values by steps of `LOG_STEP`
            levels = rendered.levels
            self.units += [(levels.values.index(name), CAMERA, pixel if name in LENGTHS else LOG_STEP)
                           for name in levels.open_values]
        count = len(self.units)
        self.square, self.gradient = torch.zeros(count, count).double(), torch.zeros(count).double()
        grids = self.grids(objective, rendered)
        for residual, (cells, rows) in zip(objective.residuals(rendered.image), grids, strict=True):
            pieces = (each.split(max(1, PIECE // count)) for each in (rows, residual.flatten()[cells]))
            for derivatives, wanted in zip(*pieces, strict=True):  # to save memory
                precise = derivatives.double()
                self.square += (precise.T @ precise).cpu()
                self.gradient += (precise.T @ wanted.double()).cpu()
        if objective.frame is not None:
            self._add_frame(objective, objective.frame, rendered)

    def weight_units(self, moving: Sequence[int]) -> list[tuple[int, int, float]]:
        """Probabilities that move too: (map, 6, step of their logarithm). None if the rendering saturates."""
        return []

    def weighed(self, step: Tensor) -> Tensor | None:
        """The weights (N,) after a step; None if they are tied."""
        return self.weights

    def is_line(self, i: int) -> bool:
        """Whether the image of map i is narrower than `WIDEST_PX`."""
        linear = self.maps[i, :4].view(2, 2).cpu().double()
        narrow, _ = torch.linalg.eigvalsh(linear @ self.covariance @ linear.T)
        return 2 * self.side * float(narrow.clamp_min(0).sqrt()) < WIDEST_PX

    def seen(self, objective: ImageObjective, step: Tensor) -> ImageObjective:
        """The objective after a step of the camera."""
        levels = objective.levels
        moved = {levels.values[k]: value * unit for value, (k, j, unit) in zip(step.tolist(), self.units, strict=True)
                 if j == CAMERA}
        return objective.seen_with(levels.adjusted(moved)) if moved else objective

    @abstractmethod
    def grids(self, objective: ImageObjective, rendered: Rendered) -> Iterator[tuple[Tensor | slice, Tensor]]:
        """For each grid, the cells with derivatives, by their numbers (L,), and these derivatives (L,parameters)."""

    def _add_frame(self, objective: ImageObjective, frame: Frame, rendered: Rendered) -> None:
        misfit = frame.misfit(rendered.maps, rendered.probabilities)
        _, weights = frame.penalty(misfit)
        slopes = frame.jacobian(rendered.maps, rendered.probabilities) * weights[:, None, None]
        columns = torch.stack([
            unit * (slopes[:, i, j] - (self.mean[j % 2] * slopes[:, i, 4 + j // 2] if j < 4 else 0))
            for i, j, unit in self.units])
        counted = 2 * objective.subpixels  # residuals of the image have variance 1 / 2n, residuals of the frame 1
        self.square += columns @ columns.T / counted
        self.gradient -= columns @ (misfit * weights) / counted

    def solve(self, damping: float) -> Tensor:
        """The step of each parameter: pixels, or multiples of `LOG_STEP` for logarithms."""
        effects = self.square.diagonal()
        ridge = damping * effects + 1e-9 * effects.max() + 1e-12
        ridge[effects < self.least_effect * effects.max()] = 1e6 * effects.max()  # these stay
        step = torch.linalg.solve(self.square + ridge.diag(), self.gradient)
        return step.clamp(-LONGEST_PX, LONGEST_PX)

    def solve_alone(self) -> Tensor:
        """The step of each parameter if only that one moves."""
        return (self.gradient / self.square.diagonal().clamp_min(1e-12)).clamp(-LONGEST_PX, LONGEST_PX)

    def moved(self, step: Tensor) -> Tensor:
        """The maps (N,6) after a step. A matrix acts about the attractor's mean."""
        change = (step.cpu().double() @ self._shifts.flatten(1)).view(self.maps.shape)
        return limited((self.maps.double() + change.to(self.maps.device)).to(self.maps), self.weights, self.largest)

    @cached_property
    def _shifts(self) -> Tensor:
        """By how much each parameter moves the maps, (parameters,N,6) float64."""
        shifts = torch.zeros(len(self.units), *self.maps.shape, dtype=torch.float64)
        for shift, (i, j, unit) in zip(shifts.numpy(), self.units, strict=True):  # tensors are slow number by number
            if j < WEIGHT:
                shift[i, j] = unit
            if j < 4:
                shift[i, 4 + j // 2] = -unit * self.mean[j % 2]
        return shifts

    def nudged(self, parameter: int, step: float) -> Tensor:
        """The maps (N,6) after a step of one parameter."""
        return self.moved(self._alone(parameter, step))

    def rendering(self, objective: ImageObjective, parameter: int, step: float) -> Tensor:
        """The rendering (R,R) after a step of one parameter."""
        alone = self._alone(parameter, step)
        return self.seen(objective, alone).render(affine.to_code(self.moved(alone), self.weights))

    def _alone(self, parameter: int, step: float) -> Tensor:
        alone = torch.zeros(len(self.units))
        alone[parameter] = step
        return alone


class FromPoints(Jacobian):
    """From one run of the chaos game with common random numbers and fixed probabilities. The grey level of a cell of
    mass m is I = 1 - exp(-kappa m), with kappa fitted to the rendering around the cell."""

    def grids(self, objective: ImageObjective, rendered: Rendered) -> Iterator[tuple[Tensor | slice, Tensor]]:
        greys, step = objective.grids(rendered.image), STEP_PX
        entries = [k for k, (_, j, _) in enumerate(self.units) if j < WEIGHT]
        nudged = (self.maps.double() + step * self._shifts[entries].to(self.maps.device)).to(self.maps)
        moved = torch.cat([self.maps[None], limited(nudged, self.weights, self.largest)])
        known, *_ = bins = orbit_bins(moved, rendered.probabilities, self.side, seed=self.seed, **self.game)
        smooth = self._smooth(greys[0]).clamp(max=1 - 0.5 / objective.subpixels)
        kappa = -(1 - smooth).log() / self._smooth(known).clamp_min(1e-12)
        kappa = torch.where(known > 0, kappa, 0)
        slope = (objective.levels.unlit(greys[0], smooth) * kappa).flatten()
        camera = [(objective.grids(self.rendering(objective, k, step))[0] - greys[0]).flatten() / step
                  for k in range(len(entries), len(self.units))]
        cells = torch.arange(len(slope), device=slope.device) if camera else slope.nonzero().flatten()
        masses = bins.flatten(1)[:, cells]
        rows = torch.stack([*((masses[1:] - masses[0]) * (slope[cells] / step)), *camera], 1)
        for k, grey in enumerate(greys):
            if k:
                cells, rows = halved(cells, rows, len(greys[k - 1]))
            factor = objective.levels.stabilizing_slope(grey, objective.subpixels * 4**k)
            yield cells, rows * factor.flatten()[cells, None]

    def _smooth(self, image: Tensor) -> Tensor:
        return avg_pool2d(image[None], WINDOW, 1, WINDOW // 2)[0]


class FromRenderings(Jacobian):
    """From renderings of the code with each parameter moved both ways. This is several times slower than `FromPoints`,
    but also correct where an image ends at the edge of a pixel, which bins cannot show."""

    def grids(self, objective: ImageObjective, rendered: Rendered) -> Iterator[tuple[Tensor | slice, Tensor]]:
        nudge = NUDGE_PX if objective.levels.is_graded else BINARY_NUDGE_PX
        columns = [grid.new_empty(len(self.units), *grid.shape) for grid in objective.stable]
        for k in range(len(self.units)):
            fro, to = (objective.stabilized(self.rendering(objective, k, step)) for step in (-nudge, nudge))
            for column, before, after in zip(columns, fro, to, strict=True):
                column[k] = (after - before) / (self._back(objective.levels, k, nudge) + nudge)
        for column in columns:
            yield slice(None), column.flatten(1).T

    def _back(self, levels: Levels, parameter: int, nudge: float) -> float:
        """How far a step back really goes: a length of the camera does not become negative."""
        k, j, unit = self.units[parameter]
        if j != CAMERA or levels.values[k] not in LENGTHS:
            return nudge
        return min(nudge, getattr(levels.camera, levels.values[k]) / unit)


def halved(cells: Tensor, rows: Tensor, side: int) -> tuple[Tensor, Tensor]:
    """The means (K,P) of 2 × 2 cells, or of what there is of them at an edge, of a grid with `side` cells a side, of
    which cells (L,) have the values (L,P), all others 0; with their numbers (K,) in a grid with half as many a side."""
    row, column = cells // side, cells % side
    parts = (side - row // 2 * 2).clamp_max(2) * (side - column // 2 * 2).clamp_max(2)
    found, index = (row // 2 * ((side + 1) // 2) + column // 2).unique(return_inverse=True)
    quarters = rows.new_zeros(len(found), 4, rows.shape[1])  # each has its place: no sum depends on an order
    quarters[index, row % 2 * 2 + column % 2] = rows / parts[:, None]
    return found, quarters.sum(1)
