"""Registration of a tree: its strokes are moved onto the lines of a picture before pixels are compared.

Strokes that lie beside the lines of a picture do not overlap them, so the difference of pixels does not say where to
move them. Distances do. This is the iterative closest point method (Besl and McKay 1992), by Levenberg-Marquardt steps
of all maps together. Distances across a stroke count more than distances along it (Chen and Medioni 1992): the nearest
point of a line is rarely the one that a point of the stroke belongs to.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ....cameras.strokes import TWIGS_PX, parts_of
from ....ifs import affine
from ....ops.collage.reference import contract
from ....runtime.deadline import NO_DEADLINE, Deadline
from ..image.gauss_newton import DAMPING, DAMPING_DOWN, DAMPING_UP, LEAST_DAMPING, TRIES
from ..image.objective import ImageObjective, Rendered
from ..limits import SMALLER
from .trunk import flat_maps_onto, lit_shape, middle_of, positions

FAR = 3.0        # times the median distance: a point farther away belongs to another line
REACH_PX = 4.0   # distance, pixels, up to which a point always counts
ALONG = 0.1      # weight of squared distances along a stroke, relative to those across it
STEPS = 60       # of a registration, at most
LITTLE = 0.001   # a registration ends if a step lowers the cost by less than this share
MOST_STROKES = 4000    # in the last generation of a drawing that is registered
MOST_POINTS = 20_000   # on the strokes, besides one for each: more are no longer a pixel apart


class Registered(NamedTuple):
    """Maps (N,6), and the mean squared distance between their strokes and the lines of the picture, canvas units: the
    sum over both directions."""

    maps: Tensor
    misfit: float


class _Tree(NamedTuple):
    """The maps (N,6) that copy a drawing, and the segments (S,2,2), pairs of ends, with which it begins."""

    copies: np.ndarray
    segments: np.ndarray

    def moved(self, step: np.ndarray) -> _Tree:
        """After a step (P,) of all its numbers. No copy has a singular value above `SMALLER`."""
        copies, segments = np.split(step, [self.copies.size])
        moved = torch.from_numpy(self.copies + copies.reshape(self.copies.shape))
        return _Tree(contract(moved, SMALLER).numpy(), self.segments + segments.reshape(self.segments.shape))


class _Points(NamedTuple):
    """Points (n,2) of strokes, their derivatives (n,2,P) by the numbers of the tree, and the directions (n,2) of the
    strokes, unit vectors."""

    places: np.ndarray
    slopes: np.ndarray
    directions: np.ndarray


class _Pairs(NamedTuple):
    """Distances (n,) of points of strokes from their nearest points of the picture, or the other way round, residuals
    (n,2) across and along the stroke, and the derivatives (n,2,P) of the residuals, with opposite signs."""

    distances: np.ndarray
    residuals: np.ndarray
    slopes: np.ndarray


class Registration:
    """Registers trees with one picture."""

    def __init__(self, objective: ImageObjective, deadline: Deadline = NO_DEADLINE):
        from scipy.spatial import KDTree

        self.params, self.deadline = objective.params, deadline
        shape = lit_shape(objective)
        self.pixel = 2 / len(shape)
        self.points = positions(shape)
        self.lit = KDTree(self.points.numpy())
        self.lines = positions(middle_of(shape)).numpy()

    def fits(self, found: Rendered) -> list[Registered]:
        """The code registered at each depth to which its strokes may be drawn, the best first. Empty if it has no
        strokes of a pixel or more, or fewer than two copies, or if the picture shows no more than a pixel."""
        segments, copies = (each.double().numpy() for each in parts_of(found.code))
        segments = segments[_lengths(segments) >= self.pixel]
        if len(copies) < 2 or not len(segments) or len(self.points) < 2:
            return []
        tree = _Tree(copies, segments)
        fits = [self.fitted(tree, depth) for depth in self.deadline.during(range(1, self._deepest(tree) + 1))]
        kept = (each for each in fits if len(parts_of(affine.to_code(each.maps))[1]) == len(copies))
        return sorted(kept, key=lambda each: each.misfit)

    def _deepest(self, tree: _Tree) -> int:
        """The depth at which there are too many strokes, or at which all of them are too short to see."""
        count = len(tree.segments)
        ratio = np.linalg.norm(tree.copies[:, :4].reshape(-1, 2, 2), 2, (1, 2)).max()
        length, depth = _lengths(tree.segments).max(), 0
        while (count * len(tree.copies) <= MOST_STROKES and length >= TWIGS_PX[0] * self.pixel):
            count, length, depth = count * len(tree.copies), length * ratio, depth + 1
        return depth

    def fitted(self, tree: _Tree, depth: int) -> Registered:
        """The tree registered at one depth."""
        pairs, damping = self._pairs(tree, depth), DAMPING
        for _ in self.deadline.during(range(STEPS)):
            reach = max(REACH_PX * self.pixel, *(FAR * np.median(each.distances) for each in pairs))
            before, (square, gradient) = _cost(pairs, reach), _normal_equations(pairs, reach)
            for _ in range(TRIES):
                step = np.linalg.solve(square + damping * np.diag(square.diagonal()), gradient)
                moved = tree.moved(step)
                others = self._pairs(moved, depth)
                if _cost(others, reach) < before:
                    tree, pairs, damping = moved, others, max(damping / DAMPING_DOWN, LEAST_DAMPING)
                    break
                damping *= DAMPING_UP
            if _cost(pairs, reach) > (1 - LITTLE) * before:
                break
        copies, segments = (torch.from_numpy(each).float() for each in tree)
        trunk = flat_maps_onto([(first, last) for first, last in segments.double()], copies, self.points)
        misfit = float(sum((each.distances**2).mean() for each in pairs))
        return Registered(torch.cat([copies, trunk.to(copies)]), misfit)

    def _pairs(self, tree: _Tree, depth: int) -> tuple[_Pairs, _Pairs]:
        """Each point of the strokes with the nearest pixel of the shape, and each pixel on a line of the picture with
        the nearest point of the strokes."""
        from scipy.spatial import KDTree

        drawn = _drawn(tree, depth, self.pixel, MOST_POINTS)
        (there, lit), (here, near) = self.lit.query(drawn.places), KDTree(drawn.places).query(self.lines)
        return (_Pairs(there, *_seen_along(drawn, self.lit.data[lit])),
                _Pairs(here, *_seen_along(_Points(*(each[near] for each in drawn)), self.lines)))


def _seen_along(points: _Points, goals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Residuals (n,2) from points to their goals (n,2), and derivatives: across the stroke, and along it, weighted."""
    x, y = points.directions.T
    axes = np.stack([np.stack([-y, x], 1), ALONG**0.5 * points.directions], 1)
    return np.einsum("nac,nc->na", axes, goals - points.places), axes @ points.slopes


def _cost(pairs: tuple[_Pairs, ...], reach: float) -> float:
    """The mean of squared residuals. Farther points count as if they were at the end of the reach."""
    return sum(np.where(each.distances < reach, (each.residuals**2).sum(1), reach**2).mean() for each in pairs)


def _normal_equations(pairs: tuple[_Pairs, ...], reach: float) -> tuple[np.ndarray, np.ndarray]:
    """The matrix (P,P) and the right-hand side (P,) of a Gauss-Newton step, from points within reach."""
    count = pairs[0].slopes.shape[-1]
    square, gradient = np.zeros((count, count)), np.zeros(count)
    for distances, residuals, slopes in pairs:
        near = distances < reach
        slopes = slopes[near].reshape(-1, count) / len(near)**0.5
        square += slopes.T @ slopes
        gradient += slopes.T @ residuals[near].ravel() / len(near)**0.5
    square[np.diag_indices(count)] += 1e-9 * np.trace(square) + 1e-12  # what no point depends on stays as it is
    return square, gradient


def _drawn(tree: _Tree, depth: int, spacing: float, most: int) -> _Points:
    """Points along the strokes that 0 to `depth` maps copy: a spacing apart, or farther so that there are at most about
    so many besides one for each stroke."""
    copies, first = tree
    linear, offset = copies[:, :4].reshape(-1, 2, 2), copies[:, 4:]
    ends, slopes = [first], [np.zeros((*first.shape, copies.size + first.size))]
    slopes[0].reshape(first.size, -1)[:, copies.size:] = np.eye(first.size)
    for _ in range(depth):
        turned = [np.einsum("cd,sedp->secp", each, slopes[-1]) for each in linear]
        for i, each in enumerate(turned):
            for c in range(2):
                each[:, :, c, 6 * i + 2 * c:6 * i + 2 * c + 2] += ends[-1]
                each[:, :, c, 6 * i + 4 + c] += 1
        ends.append(np.concatenate([ends[-1] @ each.T + shift for each, shift in zip(linear, offset, strict=True)]))
        slopes.append(np.concatenate(turned))
    every = np.concatenate(ends)
    return _along(every, np.concatenate(slopes), max(spacing, _lengths(every).sum() / most))


def _along(ends: np.ndarray, slopes: np.ndarray, spacing: float) -> _Points:
    """Points along segments (S,2,2). slopes: the derivatives (S,2,2,P) of the ends."""
    across, length = ends[:, 1] - ends[:, 0], _lengths(ends)
    count = np.maximum(1, np.ceil(length / spacing).astype(int))
    of = np.repeat(np.arange(len(ends)), count)
    share = ((np.arange(len(of)) - (count.cumsum() - count)[of] + 0.5) / count[of])[:, None]
    places = ends[of, 0] + share * across[of]
    moving = slopes[of, 0] + share[..., None] * (slopes[of, 1] - slopes[of, 0])
    return _Points(places, moving, (across / np.maximum(length, 1e-12)[:, None])[of])


def _lengths(segments: np.ndarray) -> np.ndarray:
    """The lengths (S,) of segments (S,2,2)."""
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
